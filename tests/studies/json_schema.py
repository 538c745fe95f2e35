"""The part of JSON Schema (2020-12) that the schemas here use: what it does not know it refuses."""

TYPES = {
    "object": dict,
    "array": list,
    "string": str,
    "boolean": bool,
    "integer": int,
    "number": (int, float),
    "null": type(None),
}
SAID_ONLY = {"$schema", "$defs", "title", "description"}
KNOWN = {
    "$ref",
    "type",
    "const",
    "enum",
    "anyOf",
    "properties",
    "required",
    "additionalProperties",
    "items",
}


def faults(value, schema, root=None, where="$"):
    """What is wrong with a value, as sentences: none where it is valid."""
    root = schema if root is None else root
    unknown = set(schema) - SAID_ONLY - KNOWN
    assert not unknown, f"{where}: this validator does not know {unknown}"
    if "$ref" in schema:
        yield from faults(value, resolved(root, schema["$ref"]), root, where)
    if "type" in schema and not is_a(value, schema["type"]):
        yield f"{where}: expected {schema['type']}, got {value!r}"
        return
    if "const" in schema and value != schema["const"]:
        yield f"{where}: expected {schema['const']!r}, got {value!r}"
    if "enum" in schema and value not in schema["enum"]:
        yield f"{where}: expected one of {schema['enum']}, got {value!r}"
    if "anyOf" in schema:
        tried = [list(faults(value, one, root, where)) for one in schema["anyOf"]]
        if all(tried):
            yield from min(tried, key=lambda found: -max(len(f.split(":")[0]) for f in found))
    if isinstance(value, dict):
        yield from _of_object(value, schema, root, where)
    if isinstance(value, list) and "items" in schema:
        for i, item in enumerate(value):
            yield from faults(item, schema["items"], root, f"{where}[{i}]")


def _of_object(value, schema, root, where):
    properties, more = schema.get("properties", {}), schema.get("additionalProperties", True)
    for key in set(schema.get("required", ())) - set(value):
        yield f"{where}: {key} is missing"
    for key, item in value.items():
        if key in properties:
            yield from faults(item, properties[key], root, f"{where}.{key}")
        elif more is False:
            yield f"{where}: {key} is not in the schema"
        elif isinstance(more, dict):
            yield from faults(item, more, root, f"{where}.{key}")


def is_a(value, kind):
    """Whether a value is of a JSON type; true and false are no numbers."""
    return isinstance(value, TYPES[kind]) and (kind == "boolean" or not isinstance(value, bool))


def resolved(root, reference):
    """The definition that "#/$defs/name" points to."""
    assert reference.startswith("#/"), reference
    for part in reference[2:].split("/"):
        root = root[part]
    return root
