"""A bridge of boxes on a flat site: small enough to reason about, with every kind of piece."""

import numpy as np

from authoring.shapes.component import Component, Mesh, Scatter

FACES = ((0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5))
NORMALS = ((0, 0, -1), (0, 0, 1), (0, -1, 0), (0, 1, 0), (-1, 0, 0), (1, 0, 0))


def box(low: tuple[float, float, float], high: tuple[float, float, float]) -> Mesh:
    """Build a closed box between two corners [m]."""
    unit = np.array([[x, y, z] for z in (0, 1) for y in (0, 1) for x in (0, 1)], np.float64)
    points = unit * (np.array(high) - low) + low
    corners = np.array(FACES, np.int32).reshape(-1)
    normals = np.repeat(np.array(NORMALS, np.float32), 4, axis=0)
    st = np.concatenate([points[list(face)][:, np.abs(normal) == 0] for face, normal in _faces()])
    return Mesh(points, np.full(6, 4, np.int32), corners, normals, st.astype(np.float32))


def box_bridge() -> tuple[Component | Scatter, ...]:
    """Build two spans of 18 m and 22 m, 10 m wide, deck surface at 6.55 m."""
    parts = [
        ("Deck_000", "deck_slab", "Role_DeckConcrete", "Superstructure", box((0, -5, 6.3), (40, 5, 6.55))),
        ("Pier_001_Cap", "pier_cap", "Role_CapConcrete", "Substructure", box((17.2, -5, 3.8), (18.8, 5, 4.8))),
        ("Pier_001_Column", "column", "Role_PierConcrete", "Substructure", box((17.5, -1, -1.5), (18.5, 1, 3.8))),
        ("Abutment_000", "abutment_wall", "Role_AbutmentConcrete", "Substructure", box((-2, -5, -1), (0.6, 5, 4.8))),
        ("Abutment_002", "abutment_wall", "Role_AbutmentConcrete", "Substructure", box((39.4, -5, -1), (42, 5, 4.8))),
        ("Parapet_L", "parapet", "Role_ParapetConcrete", "Furniture", box((0, 4.7, 6.55), (40, 5, 7.5))),
        ("Parapet_R", "parapet", "Role_ParapetConcrete", "Furniture", box((0, -5, 6.55), (40, -4.7, 7.5))),
    ]
    pieces = [Component(*part, instance_id=row + 1) for row, part in enumerate(parts)]
    pieces[1] = Component(*parts[1], instance_id=2, parameters={"height": 1.0})
    post = ((("Role_RailingSteel", box((-0.05, -0.05, 0), (0.05, 0.05, 0.4))),),)
    positions = np.array([[2.0 + 5 * step, -4.85, 7.5] for step in range(8)])
    posts = Scatter(
        "Railing_R_Posts",
        "railing_post",
        "Furniture",
        post,
        np.zeros(8, np.int32),
        positions,
        np.linspace(0, 1, 8),
        np.full((8, 3), [1.0, 1.0, 2.0]),
        tuple(range(20, 28)),
    )
    return (*pieces, posts)


def flat_site() -> tuple[Component | Scatter, ...]:
    """Build level ground at -0.5 m."""
    ground = box((-60, -80, -2), (100, 80, -0.5))
    return (Component("Site_Ground", "ground", "grass", "Ground", ground, 40_000),)


def _faces() -> list[tuple[tuple[int, ...], np.ndarray]]:
    return [(face, np.array(normal)) for face, normal in zip(FACES, NORMALS, strict=True)]
