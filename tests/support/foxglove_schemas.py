"""The channels of a Foxglove stream: what decodes their messages, and those in JSON held to what Foxglove publishes."""

import base64
import json

from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
from google.protobuf.descriptor import FieldDescriptor

# Names of scalar types by their numbers.
SCALARS = ("double", "bool", "string", "uint32", "fixed32")
TYPES = {getattr(FieldDescriptor, f"TYPE_{name}".upper()): name for name in SCALARS}


def times(schema):
    """Whether a message is a time or a duration, which Foxglove has otherwise in JSON than Protobuf."""
    return schema.full_name in ("google.protobuf.Timestamp", "google.protobuf.Duration")


def published(descriptor, message):
    """Holds a message in JSON to the published schema: every field is there, and of its type."""
    if times(descriptor):
        assert set(message) == {"sec", "nsec"} and all(type(value) is int for value in message.values())
        return
    fields = {field.name: field for field in descriptor.fields}
    assert set(message) == set(fields), descriptor.full_name
    for name, field in fields.items():
        assert isinstance(message[name], list) == field.is_repeated, name
        for value in message[name] if field.is_repeated else [message[name]]:
            if field.message_type:
                published(field.message_type, value)
            elif field.enum_type:
                assert value in field.enum_type.values_by_number, name
            else:
                assert type(value) is type(field.default_value if not field.is_repeated else 0), name


def declared(descriptor, schema):
    """Holds a schema that a file states to the published one."""
    if times(descriptor):
        assert set(schema["properties"]) == {"sec", "nsec"}
        return
    fields = {field.name: field for field in descriptor.fields}
    assert set(schema["properties"]) == set(fields), descriptor.full_name
    kinds = {"double": "number", "bool": "boolean", "string": "string", "uint32": "integer", "fixed32": "integer"}
    for name, field in fields.items():
        found = schema["properties"][name]
        if field.is_repeated:
            assert found["type"] == "array", name
            found = found["items"]
        if field.message_type:
            assert found["type"] == "object", name
            # What the file leaves empty it does not describe.
            if "properties" in found:
                declared(field.message_type, found)
        elif field.enum_type:
            assert found["type"] == "integer", name
        else:
            assert found["type"] == kinds[TYPES[field.type]], name


def decoders(channels):
    """The decoders of the messages of each topic, made from the server's schemas."""
    pool, decode = descriptor_pool.DescriptorPool(), {}
    for channel in channels:
        topic, name = channel["topic"], channel["schemaName"]
        if topic == "/structure":
            assert (channel["encoding"], channel["schemaEncoding"]) == ("json", "jsonschema")
            assert name == "foxglove.SceneUpdate"
            declared(SceneUpdate.DESCRIPTOR, json.loads(channel["schema"]))
            decode[topic] = json.loads
            continue
        assert (channel["encoding"], channel["schemaEncoding"]) == ("protobuf", "protobuf")
        for file in descriptor_pb2.FileDescriptorSet.FromString(base64.b64decode(channel["schema"])).file:
            pool.Add(file)
        decode[topic] = message_factory.GetMessageClass(pool.FindMessageTypeByName(name)).FromString
    return decode
