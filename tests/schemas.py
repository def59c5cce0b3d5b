"""The JSON schemas of the package."""

import json
from functools import cache
from importlib.resources import files

import jsonschema
from referencing import Registry, Resource


@cache
def schema(name):
    """The schema of a name such as "io/scene"."""
    return json.loads(files("distretarget").joinpath(f"{name}.schema.json").read_text("utf-8"))


@cache
def validator(name):
    """What validates documents by a schema, which is valid itself."""
    jsonschema.Draft202012Validator.check_schema(schema(name))
    others = Registry().with_resource("diff.schema.json", Resource.from_contents(schema("report/diff")))
    return jsonschema.Draft202012Validator(schema(name), registry=others)
