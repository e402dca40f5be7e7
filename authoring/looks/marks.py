"""Marks of weathering, each with its cause: on concrete, on steel, on a road."""

import numpy as np

from authoring.looks.members import Members, Spots
from authoring.looks.noise import I32, Floats, ramp

_FAINTEST = np.float32(1 / 512)  # below half a step of 8 bits
_LIFT = 2.4  # [m] of concrete that is cast at once
_BAY = 11.0  # [m] of a road with one crack across and at most one patch, on average
_SOOT = (0.52, 0.515, 0.49)
_LIME = (1.38, 1.37, 1.34)
_RUST = (1.05, 0.62, 0.40)
_MUD = (0.74, 0.70, 0.62)
_MOSS = (0.62, 0.66, 0.47)
_LICHEN = (1.30, 1.27, 0.98)
_WET = (0.50, 0.49, 0.45)  # algae where water runs
_DUST = (1.30, 1.26, 1.18)  # of a road, on dark bitumen
_SLIME = (0.40, 0.43, 0.33)  # algae that the river keeps wet
_FLOOD = (0.72, 0.70, 0.62)  # silt that high water left
_SEAL = (0.52, 0.52, 0.53)  # bitumen in a crack


def on_concrete(spots: Spots, members: Members, wet: Floats, rusty: Floats, age: float) -> Floats:
    """Mark concrete and stone: lifts, runs, splash, drip edges, lime, moss, lichen.

    Args:
        spots: Texels.
        members: Facts of the members.
        wet: Amount of dirty water that dripped on each [1], shape (N,), float32.
        rusty: The same for rust [1], shape (N,), float32.
        age: 0 for new, 1 for decades of weather, more for many [1].

    Returns:
        Factors [1], shape (3, N), float32.
    """
    owner, up = spots.owner, spots.normal[:, 2]
    clouds, patches, streaks = spots.clouds, spots.patches, spots.streaks
    wall, under, above = ramp(np.abs(up), 0.75, 0.45), ramp(-up, 0.5, 0.8), ramp(up, 0.5, 0.8)
    rise, depth = spots.place[:, 2] - members.low[owner], members.high[owner] - spots.place[:, 2]
    old = min(age, 1.6)
    tone = 1 + members.tone[owner] + old * (0.045 * clouds + 0.04 * patches + 0.045 * spots.stains)
    tone += 0.05 * old * wall * streaks  # deposits of every rain
    factors = np.repeat((tone * _lifts(rise, owner, members, age))[None], 3, axis=0)
    share = 1.25 - 0.75 * old  # with age, more of a wall has runs
    run = wall * ramp(depth, np.maximum(1.5 + 1.2 * old + 1.2 * clouds, 0.4), 0.0)
    _toward(factors, 0.85 * old * run * ramp(streaks, share + 0.25, share + 0.85), _SOOT)
    _toward(factors, 0.7 * old * run * ramp(-streaks, share + 0.65, share + 1.25), _LIME)
    splash = wall * members.foot[owner] * ramp(rise + 0.25 * patches + 0.2 * streaks, 1.0, 0.25)
    _toward(factors, 0.7 * old * splash, _MUD)
    drawn = 0.35 + 0.65 * ramp(streaks, -0.1, 0.7)
    _toward(factors, old * wet * drawn * np.maximum(wall, 0.4 * under), _WET)
    _waterline(factors, spots, wall, old)
    _toward(factors, 0.8 * old * rusty * drawn, _RUST)
    _toward(factors, 0.30 * old * under * ramp(clouds, -1.4, 1.6), _SOOT)
    leaks = under * ramp(spots.edge, 1.2, 0.1)
    _toward(factors, 0.6 * old * leaks * ramp(patches, 1.1, 2.2), _LIME)
    broken = 0.35 + 0.65 * ramp(patches, -0.6, 1.2)
    drip = under * members.deck[owner]
    _toward(factors, 0.55 * old * drip * ramp(spots.edge, 0.30, 0.10) * broken, _WET)
    worn = wall * ramp(spots.edge, 0.08, 0.02) * ramp(patches, 0.0, 1.2)
    _toward(factors, 0.30 * old * worn, _SOOT)
    _grown(factors, spots, members, (wall, above, rise), old)
    return factors


def _waterline(factors: Floats, spots: Spots, wall: Floats, old: float) -> None:
    """Add algae just above a river, and silt up to its high water, in place; they come within a year."""
    if np.isinf(spots.dry).all():
        return
    dry = spots.dry + 0.05 * spots.patches + 0.04 * spots.streaks
    # What lies deeper is not visible: dark there, it would brighten all other concrete, as the mean of a role is kept.
    shown = wall * ramp(spots.dry, -0.6, -0.3) * np.float32(0.5 + 0.5 * min(old, 1.0))
    _toward(factors, 0.6 * shown * ramp(dry, 1.1, 0.7), _FLOOD)
    _toward(factors, 0.9 * shown * ramp(dry, 0.42, 0.22), _SLIME)


def _grown(factors: Floats, spots: Spots, members: Members, lie: tuple[Floats, Floats, Floats], old: float) -> None:
    """Add moss where water stands and at the foot of north faces, and lichen on copings; in place."""
    (wall, above, rise), owner, patches = lie, spots.owner, spots.patches
    moist = ramp(patches + 0.9 * ramp(spots.edge, 0.4, 0.05), 1.1, 2.0)
    _toward(factors, old * above * (0.10 + 0.55 * moist), _MOSS)
    north = wall * ramp(spots.normal[:, 1], 0.2, 0.8) * members.cast[owner] * ramp(rise, 2.6, 0.2)
    _toward(factors, 0.55 * old * north * ramp(patches + 0.6 * spots.streaks, 0.4, 1.2), _MOSS)
    coping = above * members.deck[owner] * ramp(-patches, 0.9, 1.5)
    _toward(factors, 0.5 * old * coping, _LICHEN)


def on_steel(spots: Spots, members: Members, wet: Floats, rusty: Floats, age: float) -> Floats:
    """Mark steel: dirt and rust on flanges, rust along arrises and below bolts, runs from the top.

    Args:
        spots: Texels.
        members: Facts of the members.
        wet: Amount of dirty water that dripped on each [1], shape (N,), float32.
        rusty: The same for rust [1], shape (N,), float32.
        age: 0 for new, 1 for decades of weather, more for many [1].

    Returns:
        Factors [1], shape (3, N), float32.
    """
    owner, up, patches, streaks = spots.owner, spots.normal[:, 2], spots.patches, spots.streaks
    wall, above = ramp(np.abs(up), 0.75, 0.45), ramp(up, 0.5, 0.8)
    rise, depth = spots.place[:, 2] - members.low[owner], members.high[owner] - spots.place[:, 2]
    old = min(age, 1.6)
    tone = 1 + members.tone[owner] + old * (0.02 * spots.clouds + 0.02 * patches + 0.035 * spots.stains)
    tone += 0.035 * old * wall * streaks
    factors = np.repeat(tone[None], 3, axis=0)
    drawn = 0.35 + 0.65 * ramp(streaks, -0.1, 0.7)
    _toward(factors, 0.7 * old * wet * drawn, _WET)
    _toward(factors, 0.8 * old * rusty * drawn, _RUST)
    share = 1.9 - 0.6 * old
    run = wall * ramp(depth, 1.4, 0.0) * ramp(streaks, share + 0.25, share + 0.85)
    _toward(factors, 0.5 * old * run, _RUST)
    broken = ramp(patches + 0.4 * spots.clouds, 0.9 - 0.7 * old, 2.2 - 0.7 * old)
    flange = members.girder[owner] * ramp(rise + 0.04 * streaks, 0.30, 0.06)
    _toward(factors, 0.75 * old * flange * broken, _RUST)
    _toward(factors, 0.8 * old * ramp(spots.edge, 0.07, 0.015) * broken, _RUST)
    _toward(factors, 0.45 * old * above * (0.4 + 0.6 * ramp(patches, -1.0, 1.0)), _MUD)
    return factors


def on_road(spots: Spots, members: Members, wet: Floats, rusty: Floats, age: float) -> Floats:
    """Mark a road: wheel tracks and the oil between them, dust at its edges, cracks that are sealed, patches.

    Args:
        spots: Texels.
        members: Facts of the members.
        wet: Amount of dirty water that dripped on each [1], shape (N,), float32.
        rusty: The same for rust [1], shape (N,), float32.
        age: 0 for new, 1 for decades of traffic, more for many [1].

    Returns:
        Factors [1], shape (3, N), float32.
    """
    owner, patches, streaks, lane = spots.owner, spots.patches, spots.streaks, members.lane[spots.owner]
    old = min(age, 1.6)
    tone = 1 + members.tone[owner] + old * (0.02 * spots.clouds + 0.03 * streaks + 0.07 * spots.stains)
    off = np.abs(spots.edge - lane)
    track = ramp(np.abs(off - 0.88), 0.45, 0.10) + 0.5 * ramp(off, 0.40, 0.05)
    tone *= 1 - np.minimum(old * 0.16 * track * (1 + 0.15 * streaks), 0.5)
    axis = members.along[owner]
    station = axis[:, 0] * spots.place[:, 0] + axis[:, 1] * spots.place[:, 1] - members.start[owner]
    bay = station * (1 / _BAY)
    number = np.clip(bay.astype(np.int32), 0, 30)
    one, two = members.lifts[owner, 2 * number], members.lifts[owner, 2 * number + 1]
    ahead = (bay - number - 0.5) * _BAY  # [m] from the middle of the bay
    relaid = ramp(np.abs(ahead - 5 * two), 0.9 + 2.2 * np.abs(one), 0.8 + 2.2 * np.abs(one))
    relaid *= ramp(np.abs(spots.edge - lane * (1 + one)), 0.75, 0.65) * (np.abs(two) > 0.62 - 0.25 * old)
    tone *= 1 - 0.28 * relaid
    factors = np.repeat(tone[None], 3, axis=0)
    gutter = ramp(spots.edge + 0.08 * patches, 0.55, 0.05) * (0.6 + 0.3 * ramp(streaks, -1.0, 1.0))
    _toward(factors, 0.5 * old * gutter, _DUST)
    broken = ramp(patches + spots.clouds, 0.5 - 0.9 * old, 1.2 - 0.9 * old) * (1 - relaid)
    path = np.abs(ahead - 4 * one + 0.10 * spots.streaks + 0.12 * spots.clouds)
    _toward(factors, ramp(path, 0.09, 0.04) * broken * min(old, 1.0), _SEAL)
    joint = ramp(np.abs(spots.edge - 2 * lane + 0.06), 0.07, 0.03)  # where one lane was laid against the other
    _toward(factors, 0.8 * joint * min(old, 1.0) * ramp(patches + spots.clouds, 0.2, 0.9), _SEAL)
    _toward(factors, 0.5 * old * np.maximum(wet, rusty), _SEAL)
    return factors


def _toward(factors: Floats, amount: Floats, goal: tuple[float, float, float]) -> None:
    """Tint texels by an amount, in place: most causes affect few of them."""
    reached = np.flatnonzero(amount > _FAINTEST)
    if len(reached):
        share = np.minimum(amount[reached], 1)
        for channel, color in zip(factors, goal, strict=True):
            channel[reached] *= 1 + share * (color - 1)


def _lifts(rise: Floats, owner: I32, members: Members, age: float) -> Floats:
    """Compute lifts of 2.4 m with separate tones and a dark line between them."""
    lift = np.maximum(rise, 0) * (1 / _LIFT)
    number = np.minimum(lift.astype(np.int32), 63)
    line = ramp(np.abs(lift - np.round(lift)) * _LIFT, 0.05, 0.02) * (lift > 0.5)
    shade = (0.05 + 0.05 * min(age, 1.0)) * members.lifts[owner, number]
    return (1 + members.cast[owner] * (shade - 0.22 * min(age, 1.0) * line)).astype(np.float32)
