"""The one table of components and classes."""

import pytest

from groundwork.errors import InputError
from usd_schemas.components import (
    BACKGROUND,
    NOISY_POINT,
    UNLABELED,
    class_id,
    class_of,
    class_rows,
    component_classes,
)

PAPER = (
    "background",
    "abutment",
    "arch",
    "beam",
    "bearing",
    "cable",
    "cable_base",
    "cable_top",
    "column",
    "deck",
    "girder",
    "parapet",
    "pier_cap",
    "slab",
    "sleeper",
    "track",
    "noisy_point",
)


def test_the_seventeen_classes_and_unlabeled() -> None:
    """Ids 0 to 16 in the paper's order, 255 for what has no class; names and colors are unique."""
    rows = class_rows()
    assert tuple(row.name for row in rows[:-1]) == PAPER
    assert [row.id for row in rows] == [*range(17), 255]
    assert (rows[BACKGROUND].name, rows[NOISY_POINT].name, rows[-1].id) == ("background", "noisy_point", UNLABELED)
    assert len({row.color for row in rows}) == len({row.name for row in rows}) == len(rows)
    assert all(0 <= value <= 255 for row in rows for value in row.color)


def test_every_component_has_a_class() -> None:
    """The table leads from each component to a class that exists, and every geometric class has components."""
    names = {row.name for row in class_rows()}
    table = component_classes()
    assert set(table.values()) == names - {"noisy_point", "unlabelled"}
    assert all(class_of(kind) == name and class_id(name) <= 15 for kind, name in table.items())
    assert all(kind == kind.lower() and kind.isidentifier() for kind in table)


def test_members_of_the_structure_have_the_class_of_their_work() -> None:
    """The paper's classes by what a member does: cables end in bases at deck and anchorage, in tops on towers."""
    expected = {
        "cable": "main_cable stay hanger",
        "cable_base": "cable_socket cable_clamp",
        "cable_top": "saddle upper_anchorage",
        "bearing": "bearing_pot bearing_pad bearing_plinth",
        "arch": "arch_ring arch_rib arch_brace spandrel_wall",
        "beam": "plate_girder floor_beam cross_frame stiffener splice_plate",
        "girder": "concrete_girder diaphragm edge_beam box_girder",
        "pier_cap": "pier_cap cross_head",
        "abutment": "abutment_wall wing_wall abutment_footing anchor_block backwall",
        "parapet": "parapet railing railing_post parapet_coping",
    }
    for name, kinds in expected.items():
        assert {kind for kind, own in component_classes().items() if own == name} == set(kinds.split())


def test_unknown_names_are_bad_input() -> None:
    """The message lists what is allowed."""
    with pytest.raises(InputError, match=r"unknown component .*'girdr'.*concrete_girder"):
        class_of("girdr")
    with pytest.raises(InputError, match=r"unknown class .*'girdr'.*girder"):
        class_id("girdr")
