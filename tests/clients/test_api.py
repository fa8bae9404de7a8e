"""The control API, held to its own OpenAPI document by schemathesis and openapi-spec-validator."""

import json
import pathlib
import socket
import urllib.error
import urllib.request

import pytest
import schemathesis
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from jsonschema import Draft202012Validator
from openapi_spec_validator import OpenAPIV31SpecValidator
from schemathesis import GenerationMode
from schemathesis.specs.openapi.checks import positive_data_acceptance

from rig import HOST, Rig

TOKEN = "a-token-for-the-tests"
BEARER = {"Authorization": f"Bearer {TOKEN}"}
EXAMPLES = 20
SECONDS = 10

DOCUMENT = pathlib.Path(__file__).parents[2] / "crates/server/src/api/openapi.json"
# Replies that come as a stream of events do not end by themselves: they have a test of their own.
STREAMS = ["/v1/events", "/v1/traffic", "/v1/play"]
OPERATIONS = [
    (method, path)
    for path, item in json.loads(DOCUMENT.read_text())["paths"].items()
    for method in item
    if path not in STREAMS
]

RIG = f"""\
[rig]
clock = "x1000"
api = "{{host}}:0"
api_token = "{TOKEN}"
[[drive]]
name = "a"
model = "SMSD-4.2LAN"
modbus_tcp = "{{host}}:0"
[[drive.switch]]
input = "IN1"
closed = [-10.0, 10.0]
[[drive]]
name = "b"
model = "SMSD-8.0LAN"
modbus_tcp = "{{host}}:0"
[[drive]]
name = "uhv"
model = "SMD3"
serial_tcp = "{{host}}:0"
[[wire]]
from = "a.relay"
to = "b.CONTINUE"
delay = "5ms"
"""

# What a generator does not hit upon.
NAMES = {
    "drive": ["a", "b", "uhv"],
    "input": ["IN0", "STEP", "LIMIT_NEGATIVE"],
    "fault": ["IN1", "rotor", "motor", "thermocouple", "connection"],
}
WORDS = {
    "setting": ["off", "blocked", "short", "open", "bounce", "cut"],
    "until": ["idle", "a.READY", "uhv.BAKE or b.ABS_POS > 5"],
    "within": ["1min", None],
    "for": ["1ms", "2s"],
    "from": ["a.relay"],
    "to": ["b.CONTINUE"],
    "do": [["input a.IN0 pulse 5ms", "power b off for 2s"], ["wire a.relay b.CONTINUE cut"]],
}


class ApiRig(Rig):
    """Two SMSDs joined by a wire, an SMD3, and the control API with a token."""

    text = RIG

    def __init__(self, folder):
        super().__init__(folder, "")
        self.url = ""
        self.lines = ("", 0)

    def _announced(self, ready):
        assert [drive["name"] for drive in ready["drives"]] == ["a", "b", "uhv"]
        self.url = ready["api"]
        host, port = ready["drives"][2]["serial_tcp"].rsplit(":", 1)
        self.lines = (host, int(port))
        assert self.url.startswith(f"http://{HOST}:")

    def open(self, path: str, body=None, **headers):
        request = urllib.request.Request(self.url + path, data=body, headers=headers)
        return urllib.request.urlopen(request, timeout=SECONDS)

    def document(self) -> dict:
        with self.open("/openapi.json", **BEARER) as reply:
            return json.load(reply)


@pytest.fixture(scope="module")
def rig(tmp_path_factory):
    """A running rig. It must still be running when all tests are over, and end with 0."""
    rig = ApiRig(tmp_path_factory.mktemp("api"))
    try:
        rig.start()
        yield rig
        assert rig.is_running(), rig.complaints()
        rig.stop()
    finally:
        rig.clean_up()


@pytest.fixture(scope="module")
def api(rig):
    """The API as it describes itself."""
    return schemathesis.openapi.from_dict(rig.document())


def with_names(case, data):
    """Mostly names that the rig has, and often words that mean something to it."""
    if case.path_parameters and data.draw(st.integers(0, 3)):
        case.path_parameters = {name: data.draw(st.sampled_from(NAMES[name])) for name in case.path_parameters}
    if isinstance(case.body, dict) and data.draw(st.booleans()):
        words = {name: data.draw(st.sampled_from(WORDS[name])) for name in case.body if name in WORDS}
        case.body = {**case.body, **words}


def holds(strategy, answers):
    """Tries it with many cases, the same each time."""
    many = settings(max_examples=EXAMPLES, deadline=None, derandomize=True, suppress_health_check=list(HealthCheck))
    many(given(case=strategy, data=st.data())(answers))()


@pytest.mark.parametrize(("method", "path"), OPERATIONS)
def test_every_operation_answers_as_its_document_says(rig, api, method, path):
    def answers(case, data):
        with_names(case, data)
        # Whether a name is there, or a text has a meaning, no schema can say.
        excluded = [positive_data_acceptance]
        case.call_and_validate(base_url=rig.url, headers=BEARER, timeout=SECONDS, excluded_checks=excluded)

    holds(api[path][method].as_strategy(generation_mode=GenerationMode.POSITIVE), answers)


@pytest.mark.parametrize(("method", "path"), [row for row in OPERATIONS if row[0] != "get"])
def test_every_operation_refuses_what_its_document_forbids(rig, api, method, path):
    def answers(case, data):
        case.call_and_validate(base_url=rig.url, headers=BEARER, timeout=SECONDS)

    holds(api[path][method].as_strategy(generation_mode=GenerationMode.NEGATIVE), answers)


def test_the_document_is_a_valid_one_and_the_one_in_the_sources(rig):
    document = rig.document()
    OpenAPIV31SpecValidator(document).validate()
    assert document == json.loads(DOCUMENT.read_text())


def test_every_example_of_the_document_holds_to_its_schema(rig):
    document = rig.document()
    seen = 0
    for schema, example in examples(document):
        Draft202012Validator({**schema, "components": document["components"]}).validate(example)
        seen += 1
    assert seen > 30


def examples(node):
    """Every example in a document, with its schema."""
    if isinstance(node, list):
        for item in node:
            yield from examples(item)
    elif isinstance(node, dict):
        if "schema" in node:
            given = [node["example"]] if "example" in node else []
            given += [example["value"] for example in node.get("examples", {}).values()]
            yield from ((node["schema"], example) for example in given)
        elif isinstance(node.get("examples"), list):
            yield from ((node, example) for example in node["examples"])
        for item in node.values():
            yield from examples(item)


def test_an_event_holds_to_the_schema_of_the_rig(rig):
    document = rig.document()
    with rig.open("/v1/events?every=20ms", **BEARER) as reply:
        assert reply.headers["Content-Type"] == "text/event-stream"
        assert reply.readline() == b"event: state\n"
        event = json.loads(reply.readline().removeprefix(b"data: "))
    schema = {"$ref": "#/components/schemas/Rig", "components": document["components"]}
    Draft202012Validator(schema).validate(event)


def test_an_event_of_one_drive_holds_to_the_same_schema_and_has_its_mechanism(rig):
    document = rig.document()
    with rig.open("/v1/events?drive=uhv", **BEARER) as reply:
        reply.readline()
        event = json.loads(reply.readline().removeprefix(b"data: "))
    schema = {"$ref": "#/components/schemas/Rig", "components": document["components"]}
    Draft202012Validator(schema).validate(event)
    assert [drive["name"] for drive in event["drives"]] == ["uhv"]
    assert event["drives"][0]["mechanism"]["travel"] is None


def test_what_a_client_says_is_overheard_as_the_schema_says(rig):
    schema = {"$ref": "#/components/schemas/Traffic", "components": rig.document()["components"]}
    heard = []
    with rig.open("/v1/traffic?drive=uhv&every=20ms", **BEARER) as reply:
        for said in (b"", b"VMAX\r\n"):
            if said:
                with socket.create_connection(rig.lines, SECONDS) as client:
                    client.sendall(said)
                    client.recv(100)
            assert reply.readline() == b"event: traffic\n"
            data = json.loads(reply.readline().removeprefix(b"data: "))
            assert reply.readline() == b"\n"
            Draft202012Validator(schema).validate(data)
            heard += [(row["to"], row["bad"]) for row in data["rows"]]
    assert heard == [("drive", False), ("client", False)]


def test_a_scenario_is_told_as_the_schemas_say(rig):
    components = rig.document()["components"]
    scenario = 'name = "x"\n[[step]]\ndo = ["power b on", "input b.IN0 1"]\nexpect = "b.IN0"\n[[step]]\nexpect = "uhv.BAKE"\n'
    body = json.dumps({"scenario": scenario}).encode()
    schemas = {"step": "StepEvent", "report": "Report"}
    told = []
    with rig.open("/v1/play", body, **BEARER, **{"Content-Type": "application/json"}) as reply:
        while name := reply.readline().removeprefix(b"event: ").strip().decode():
            data = json.loads(reply.readline().removeprefix(b"data: "))
            assert reply.readline() == b"\n"
            schema = {"$ref": f"#/components/schemas/{schemas[name]}", "components": components}
            Draft202012Validator(schema).validate(data)
            told.append(name)
    assert told == ["step"] * 4 + ["report"]


@pytest.mark.parametrize(
    ("headers", "status"),
    [
        ({}, 401),
        ({"Authorization": "Bearer another-token-than-that"}, 401),
        ({**BEARER, "Host": "evil.example"}, 403),
        ({**BEARER, "Origin": "http://evil.example"}, 403),
    ],
)
def test_who_may_not_control_the_rig_is_told_so(rig, headers, status):
    with pytest.raises(urllib.error.HTTPError) as refused:
        rig.open("/v1/rig", **headers)
    assert refused.value.code == status
    assert json.load(refused.value)["error"]
