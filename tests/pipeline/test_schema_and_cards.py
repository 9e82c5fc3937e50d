"""What editors and readers are told comes from the signatures and docstrings alone."""

from __future__ import annotations

from fogpipe.pipeline.cards import card, card_data
from fogpipe.pipeline.schema import pipeline_schema


def test_a_card_names_ports_parameters_units_bounds_and_defaults(registry):
    data = card_data(registry.find("toy.transmission"), "somewhere 1.0")
    assert [port["name"] for port in data["inputs"]] == ["range_map", "density (optional)"]
    assert data["parameters"][0] == {
        "name": "extinction",
        "type": "float ≥ 0",
        "default": "0.1",
        "unit": "1/m",
        "description": "per metre.",
    }
    assert data["parameters"][1]["type"] == "exponential or linear"
    text = card(registry.find("toy.transmission"), "somewhere 1.0")
    assert text.startswith("# toy.transmission\n\nTransmission of a toy medium.")
    assert "| extinction | float ≥ 0 | 0.1 | 1/m | per metre. |" in text


def test_a_card_of_several_outputs_describes_each(registry):
    outputs = card_data(registry.find("toy.split"))["outputs"]
    assert outputs == [
        {"name": "near", "kind": "Mask", "description": "(H, W) bool."},
        {"name": "far", "kind": "Mask", "description": "(H, W) bool."},
    ]


def test_a_card_says_when_the_stage_is_skipped(registry):
    assert "skipped when the distance is 0" in card(registry.find("toy.farther"))


def test_every_stage_of_fogpipe_documents_its_ports_and_parameters(registry):
    for name, contract in registry.all().items():
        data = card_data(contract)
        assert data["summary"].endswith("."), name
        for item in (*data["inputs"], *data["parameters"]):
            assert item["description"], f"{name}: {item['name']}"


def test_the_schema_knows_stages_ports_and_parameters(registry):
    schema = pipeline_schema(registry)
    stage = schema["$defs"]["toy.transmission"]["properties"]
    assert set(stage["in"]["properties"]) == {"range_map", "density"}
    assert stage["in"]["required"] == ["range_map"]
    extinction = stage["with"]["properties"]["extinction"]["anyOf"][0]
    assert (extinction["minimum"], extinction["default"], extinction["type"]) == (0, 0.1, "number")
    assert "toy.transmission" in schema["$defs"]["StageUse"]["allOf"][0]["properties"]["use"]["enum"]
    assert "Range" in schema["properties"]["inputs"]["additionalProperties"]["enum"]


def test_every_reference_in_the_schema_leads_somewhere(registry):
    schema = pipeline_schema(registry)
    seen = []

    def walk(item):
        if isinstance(item, dict):
            if "$ref" in item:
                seen.append(item["$ref"])
            for value in item.values():
                walk(value)
        elif isinstance(item, list):
            for value in item:
                walk(value)

    walk(schema)
    assert seen
    assert {ref.removeprefix("#/$defs/") for ref in seen} <= schema["$defs"].keys()
