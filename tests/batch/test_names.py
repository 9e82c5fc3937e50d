"""What outputs are called."""

from __future__ import annotations

import pytest

from fogpipe.batch.names import PRESETS, filled, inside, known_values, layout_from
from fogpipe.batch.variation import Variant
from fogpipe.datasets.item import Item
from fogpipe.errors import OutputError, RequestError


def fields(item_id: str, **settings: float) -> dict:
    return known_values(Item(item_id, {"image": "x/19.jpg"}), Variant("", settings, draw=0, seed=0))


FIELDS = fields("train/aachen/aachen_000000_000019", **{"fog.visibility": 150.0})


def test_fields_are_the_item_and_its_parameters():
    assert filled("{folder}/{name}{suffix}", FIELDS) == "train/aachen/aachen_000000_000019.jpg"
    assert filled("{id}_vis{visibility:g}.png", FIELDS) == "train/aachen/aachen_000000_000019_vis150.png"
    assert filled("{id}_{fog.visibility:07.2f}.png", FIELDS).endswith("_0150.00.png")


def test_by_default_names_mirror_the_input_and_tell_what_differs():
    assert layout_from(None, None, [], 1, ".png").picture == "{path}.png"
    layout = layout_from(None, None, ["fog.visibility"], 3, ".jpg")
    assert filled(layout.picture, FIELDS) == "train/aachen/aachen_000000_000019_visibility150_0.jpg"
    assert filled(layout.picture, FIELDS | {"path": "rgb/19"}) == "rgb/19_visibility150_0.jpg"


def test_the_names_of_foggy_cityscapes():
    layout, known = PRESETS["foggy-cityscapes"], FIELDS | {"extinction": 0.02}
    picture = "leftImg8bit_foggy/train/aachen/aachen_000000_000019_leftImg8bit_foggy_beta_0.02.png"
    assert filled(layout.picture, known) == picture
    transmittance = "leftImg8bit_transmittance/train/aachen/aachen_000000_000019_leftImg8bit_transmittance_beta_0.02"
    assert filled(layout.extra, known | {"output": layout.called("transmission")}) == transmittance


def test_the_names_of_reside():
    layout, known = PRESETS["reside"], fields("0025") | {"airlight": 0.8, "extinction": 0.04}
    assert filled(layout.picture, known) == "hazy/0025_0.8_0.04.png"
    assert filled(layout.clear, known) == "clear/0025.jpg"


@pytest.mark.parametrize("path", ["../x.png", "a/../../x.png", "/etc/x.png", "a//x.png", "", "C:/x.png", "a\0b"])
def test_no_name_leads_out_of_the_folder(path: str):
    with pytest.raises(OutputError, match="which is not a path below"):
        inside(path, "the template gives")


def test_the_name_of_the_journal_is_kept_for_it():
    with pytest.raises(OutputError, match="kept for fogpipe itself"):
        filled("{id}.png", {"id": ".fogpipe/journal/1"})


def test_an_id_that_climbs_is_refused_in_a_template():
    with pytest.raises(OutputError, match=r'gives "\.\./\.\./secret\.png"'):
        filled("{id}.png", {"id": "../../secret"})


@pytest.mark.parametrize(
    ("template", "message"),
    [
        ("{id.__class__}.png", r'has no field "id.__class__"'),
        ("{id[0]}.png", r'has no field "id\[0\]"'),
        ("{visibilty}.png", 'Did you mean "visibility"'),
        ("{id:d}.png", "cannot be filled in"),
        ("{id", "cannot be filled in"),
        ("{}.png", 'has no field "0"'),
    ],
)
def test_a_template_only_names_fields(template: str, message: str):
    with pytest.raises(RequestError, match=message):
        filled(template, FIELDS)


def test_a_preset_and_a_template_together_are_refused():
    with pytest.raises(RequestError, match="give one of them"):
        layout_from("reside", "{id}.png", [], 1, ".png")
    with pytest.raises(RequestError, match="no such layout"):
        layout_from("resid", None, [], 1, ".png")
