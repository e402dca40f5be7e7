"""Which surface fills which material role of a bridge in each look."""

from usd_schemas.tokens import ROLES

_WEATHERED: dict[str, str] = {
    "Role_AbutmentConcrete": "board_concrete",
    "Role_PierConcrete": "panel_concrete",
    "Role_CapConcrete": "panel_concrete",
    "Role_GirderConcrete": "smooth_concrete",
    "Role_DeckConcrete": "smooth_concrete",
    "Role_ParapetConcrete": "board_concrete",
    "Role_KerbConcrete": "deck_concrete",
    "Role_DeckAsphalt": "asphalt",
    "Role_RoadMarking": "road_marking",
    "Role_BearingRubber": "rubber",
    "Role_GirderSteel": "painted_steel",
    "Role_RailingSteel": "galvanised_steel",
    "Role_CableSteel": "galvanised_steel",
    "Role_RailSteel": "rail_steel",
    "Role_SleeperTimber": "timber",
    "Role_Ballast": "ballast",
    "Role_Masonry": "masonry",
}

_AGELESS = ("timber", "ballast")

LOOKS: dict[str, dict[str, str]] = {
    "weathered": {role: _WEATHERED[role] for role in ROLES},
    "clean": {role: name if (name := _WEATHERED[role]) in _AGELESS else f"{name}_clean" for role in ROLES},
}

AGES = {"weathered": 1.0, "clean": 0.15}  # how far the weather has come in each look, 0 to 1
