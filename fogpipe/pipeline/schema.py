"""The JSON Schema of pipeline files, from the same models that check them."""

from __future__ import annotations

from typing import Any

from fogpipe.pipeline.cards import card_data
from fogpipe.pipeline.spec import PipelineFile
from fogpipe.ports import known_kinds
from fogpipe.registry import Registry
from fogpipe.stage import Contract


def pipeline_schema(registry: Registry) -> dict[str, Any]:
    """A schema that knows every stage, its ports and its parameters."""
    schema = PipelineFile.model_json_schema(by_alias=True)
    definitions = schema.setdefault("$defs", {})
    stages = registry.all()
    for name, contract in stages.items():
        definitions[name] = _stage(contract)
        for key, value in definitions[name].pop("$defs", {}).items():
            definitions.setdefault(key, value)
    ports = (port for contract in stages.values() for port in (*contract.inputs, *contract.outputs))
    kinds = known_kinds().keys() | {port.kind.name for port in ports}
    uses = {"properties": {"use": {"enum": sorted(stages)}}}
    branches = [
        {"if": {"properties": {"use": {"const": name}}}, "then": {"$ref": f"#/$defs/{name}"}} for name in stages
    ]
    definitions["StageUse"]["allOf"] = [uses, *branches]
    schema["properties"]["inputs"]["additionalProperties"] = {"enum": sorted(kinds)}
    schema["$schema"] = "https://json-schema.org/draft/2020-12/schema"
    schema["title"] = "fogpipe pipeline"
    return schema


def _stage(contract: Contract) -> dict[str, Any]:
    parameters = contract.model.model_json_schema()
    words = {parameter["name"]: parameter["description"] for parameter in card_data(contract)["parameters"]}
    for name, item in parameters.get("properties", {}).items():
        item["description"] = words[name]
    # $name stands for a parameter of the pipeline, whatever the type.
    values = {
        name: {"anyOf": [item, {"type": "string", "pattern": r"^\$"}]}
        for name, item in parameters.get("properties", {}).items()
    }
    ports = {port.name: {"type": "string", "description": f"{port.kind}"} for port in contract.inputs}
    needed = [port.name for port in contract.inputs if not port.optional]
    return {
        "description": contract.summary,
        "$defs": parameters.get("$defs", {}),
        "properties": {
            "in": {"type": "object", "properties": ports, "required": needed, "additionalProperties": False},
            "with": {"type": "object", "properties": values, "additionalProperties": False},
        },
    }
