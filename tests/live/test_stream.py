"""The messages that the live view sends to clients other than its own page, and the requests that it refuses."""

import base64
import json
import os
import socket
import subprocess
import time
import urllib.error
import urllib.request
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from foxglove_schemas import decoders, published
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate
from live_view import OPEN, SMALL_RANGE, Viewer, address, free_run
from processes import PATIENCE_S, wait_until
from recordings import RECEIVED, SENT, Recording, unpacked
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect

# Where `tests/run` puts what package.json asks for.
NODE_MODULES = os.environ.get("RESONARM_NODE_MODULES", "target/tests/npm/node_modules")
# Commands, and the frames of a sample, with the base identifier 0x200 (firmware-protocol/SPEC.md).
COMMANDS, SAMPLES = {0x201, 0x202}, {0x203, 0x204, 0x205}
SUBPROTOCOLS = ("foxglove.websocket.v1", "foxglove.sdk.v1")


def test_the_numbers_are_those_that_are_recorded(programs, tmp_path):
    recording, table, scenario = tmp_path / "run.mcap", tmp_path / "table", tmp_path / "small_range.toml"
    scenario.write_text(SMALL_RANGE.format(1.0))
    run = free_run(programs, "--record", recording, "--scenario", scenario)
    viewer = Viewer(*address(run))
    # The page is there a little before the loop that takes set-points, whose first sample shows that it runs.
    viewer.next("update", lambda update: update["rows"] > 0)
    assert viewer.ask({"set": {"load": 50, "frequency_hz": 18, "phase_deg": 0}}) == {"kind": "taken"}
    rows, stretches = {}, {}
    while len(rows) < 1500:
        update = viewer.next("update")
        both = zip(update["numbers"], update["rows_clipped"], strict=True)
        rows |= {update["first"] + k: row for k, row in enumerate(both)}
        all_three = zip(update["least"], update["largest"], update["stretches_clipped"], strict=True)
        stretches |= dict(zip(update["stretches"], all_three, strict=True))
    assert viewer.about["channels"][2:4] == ["force_x_n", "force_y_n"]
    assert run.stop() == 0
    exported = programs.resonarm("export", recording, "--to", "csv", "--parts", "samples,states", "--out", table)
    assert exported.wait() == 0, exported.stderr
    columns = {}
    for path in tmp_path.glob("table*.csv"):
        names, *lines = path.read_text().splitlines()
        values = np.genfromtxt(lines, delimiter=",")
        columns |= dict(zip(names.split(","), values.T, strict=True))
    first = int(columns["sample"][0])
    recorded = np.array([columns[name] for name in viewer.about["channels"]]).T
    clipped = columns["clipped"].astype(int)
    assert viewer.about["clipped_bits"] == viewer.about["channels"][6:10] + viewer.about["channels"][4:6]
    for sample, (row, bits) in rows.items():
        assert np.allclose(row, recorded[sample - first], rtol=1e-6, atol=1e-12), sample
        assert bits == clipped[sample - first], sample
    # The third of these channels is C along x, whose range is small: it is clipped alone at times, and at times nothing
    # is.
    assert {0, 0b0100} <= {bits for _, bits in rows.values()}
    for begin, (least, largest, bits) in stretches.items():
        samples = recorded[begin - first : begin - first + 10]
        # The stretches at either end may lack samples.
        if len(samples) == 10 and begin >= 10:
            assert np.allclose(least, samples.min(axis=0), rtol=1e-6, atol=1e-12), begin
            assert np.allclose(largest, samples.max(axis=0), rtol=1e-6, atol=1e-12), begin
            assert bits == np.bitwise_or.reduce(clipped[begin - first : begin - first + 10]), begin


def get(url, path="", **headers):
    """Status and text of an answer."""
    request = urllib.request.Request(url + path, headers={name.title(): value for name, value in headers.items()})
    try:
        with urllib.request.urlopen(request, timeout=PATIENCE_S) as answer:
            return answer.status, answer.read().decode()
    except urllib.error.HTTPError as error:
        return error.code, error.read().decode()


def test_foreign_origins_and_hosts_are_refused(programs):
    url, _ = address(free_run(programs))
    assert get(url)[0] == 200 and "<title>Resonarm</title>" in get(url)[1]
    assert get(url, "no-such-file")[0] == 404
    status, why = get(url, origin="http://example.com")
    said = "the origin `http://example.com` is not this server's: allow it by --live-origin http://example.com\n"
    assert (status, why) == (403, said)
    assert get(url, host="rebound.example.com")[0] == 403
    for origin in ("http://example.com", "null", url[:-1].replace("http", "https")):
        with pytest.raises(InvalidStatus) as refused:
            Viewer(url, origin=origin)
        assert refused.value.response.status_code == 403
    Viewer(url, origin=url[:-1])


def raw(url):
    """A connection without any message so far."""
    host, port = url.removeprefix("http://").rstrip("/").split(":")
    return socket.create_connection((host, int(port)), PATIENCE_S)


def status(url, *headers):
    """The status of the answer to a request with these headers."""
    with raw(url) as connection:
        lines = ["GET / HTTP/1.1", *headers, "Connection: close", "", ""]
        connection.sendall("\r\n".join(lines).encode())
        return int(connection.makefile("rb").readline().split()[1])


def test_a_request_that_has_its_host_or_origin_twice_or_no_host_is_a_bad_one(programs):
    url, _ = address(free_run(programs))
    host, own = "Host: 127.0.0.1:1", "Origin: http://127.0.0.1:1"
    foreign = "Origin: http://example.com"
    assert [status(url, host, own), status(url, host, foreign)] == [200, 403]
    twice = [(host, own, foreign), (host, foreign, own), (host, own, own), (host, "Host: example.com"), (host, host)]
    assert [status(url, *headers) for headers in twice] == [400] * 5
    assert status(url, own) == 400


def test_who_sends_no_whole_request_is_let_go_and_keeps_nobody_out(programs):
    """No more connections than the server takes at once are open at any time; the others wait until it has let go of
    those that say nothing, five seconds after it took them."""
    run = free_run(programs)
    url, token = address(run)
    before = Viewer(url, token)
    open_files = lambda: len(list(Path(f"/proc/{run.process.pid}/fd").iterdir()))
    at_first = open_files()
    halves = ["", "G", "GET / HTTP/1.1\r\nHost: 127.0.0.1\r\n"]
    idle = [raw(url) for _ in range(80)]
    for place, connection in enumerate(idle):
        connection.sendall(halves[place % 3].encode())
    with ThreadPoolExecutor(1) as pool:
        page, most = pool.submit(get, url), 0
        while not page.done():
            most = max(most, open_files() - at_first)
            time.sleep(0.02)
        assert page.result()[0] == 200
    # The server takes 64 connections at once, of which the viewer and the page may have some.
    assert 60 <= most <= 64
    for connection in idle:
        assert connection.recv(1) == b""
    # A WebSocket may say nothing for as long as it likes.
    assert before.ask("disarm") == {"kind": "taken"}


def test_an_origin_that_is_allowed_may_look(programs):
    url, _ = address(free_run(programs, "--live-origin", "https://app.foxglove.dev"))
    Viewer(url, origin="https://app.foxglove.dev")
    with pytest.raises(InvalidStatus):
        Viewer(url, origin="https://foxglove.dev")


def test_nonsense_and_wrong_tokens_change_nothing(programs):
    run = free_run(programs)
    url, token = address(run)
    viewer = Viewer(url, token)
    wrong = "the token is wrong: open the page by the address that the terminal shows"
    for guess in ("0" * 32, "", token[1:]):
        assert viewer.ask("disarm", guess) == {"kind": "refused", "why": wrong}
    for request, action in [("arm", "arm"), ("reset", "reset"), ({"seek": {"time_s": 1}}, "play")]:
        why = f"{action} can't be asked of a plant and exciter"
        assert viewer.ask(request) == {"kind": "refused", "why": why}
    good = {"load": 1, "frequency_hz": 20, "phase_deg": 0}
    for wrong, why in [
        ({"load": 100.5}, "the load is 100.5 N: it must be from 0 to 100 N"),
        ({"load": -1}, "the load is -1 N: it must be from 0 to 100 N"),
        ({"frequency_hz": 500}, "the frequency is 500 Hz: it must be from 0.01 to 499.5 Hz"),
        ({"phase_deg": 361}, "the phase is 361 °: it must be from -360 to 360 °"),
    ]:
        assert viewer.ask({"set": good | wrong}) == {"kind": "refused", "why": why}
    nothing = "EOF while parsing a value at line 1 column 0"
    for said, why in [("", nothing), ("{}", "missing field `token` at line 1 column 2")]:
        assert viewer.say(said) == {"kind": "refused", "why": f"this is not a request: {why}"}
    # A viewer that keeps doing this is dropped, as is one whose message is too long; the others are not affected.
    other = Viewer(url)
    with pytest.raises(ConnectionClosed):
        for _ in range(50):
            viewer.say("nonsense")
    long = Viewer(url)
    with pytest.raises(ConnectionClosed):
        long.say("x" * 100_000)
    other.next("update", lambda update: update["sample"] > 100)
    with socket.create_connection(("127.0.0.1", int(url.rstrip("/").rsplit(":")[-1]))) as raw:
        raw.sendall(b"\x16\x03\x01\x00nonsense\r\n\r\n")
    assert Viewer(url, token).ask("disarm") == {"kind": "taken"}
    assert run.wait() == 0


def asked(url, path, *headers):
    """A connection that asks to become a WebSocket."""
    connection = raw(url)
    lines = [
        f"GET {path} HTTP/1.1", "Host: 127.0.0.1:1", "Upgrade: websocket", "Connection: Upgrade",
        "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==", "Sec-WebSocket-Version: 13", *headers, "", "",
    ]
    connection.sendall("\r\n".join(lines).encode())
    return connection


def answered(connection):
    """The status of an answer, whose head is read."""
    head = b""
    while not head.endswith(b"\r\n\r\n"):
        byte = connection.recv(1)
        assert byte, head
        head += byte
    return int(head.split()[1])


def test_the_head_of_a_long_frame_ends_the_connection_before_memory_is_reserved(programs):
    """14 bytes, a frame of 16 MiB - 1 bytes, reserved as much memory for each viewer, which a real-time run locks."""
    run = free_run(programs)
    url, _ = address(run)
    size_kib = lambda: int(Path(f"/proc/{run.process.pid}/status").read_text().split("VmData:")[1].split()[0])
    viewer = Viewer(url)
    before = size_kib()
    for path, *headers in (("/live",), ("/", "Sec-WebSocket-Protocol: foxglove.sdk.v1")):
        connections = [asked(url, path, *headers) for _ in range(10)]
        for connection in connections:
            assert answered(connection) == 101
            connection.sendall(b"\x81\xff" + ((16 << 20) - 1).to_bytes(8, "big") + bytes(4))
        for connection in connections:
            with connection:
                while True:
                    try:
                        if not connection.recv(1 << 16):
                            break
                    except ConnectionResetError:
                        break
    assert size_kib() - before < 10 * 16_000
    viewer.next("update", lambda update: update["viewers"] == 1)


def test_there_are_no_more_viewers_than_the_server_has_memory_for(programs):
    url, _ = address(free_run(programs))
    # All at once: one that reads nothing is dropped after ten seconds.
    viewers = [asked(url, "/live") for _ in range(80)]
    said = [answered(connection) for connection in viewers]
    assert set(said) == {101, 503} and said.count(101) >= 64, said
    for connection in viewers:
        connection.close()


HEADERS = {
    "content-security-policy": ["default-src 'self'", "base-uri 'none'", "form-action 'none'", "frame-ancestors 'none'"],
    "cross-origin-resource-policy": ["same-origin"],
    "cross-origin-opener-policy": ["same-origin"],
    "permissions-policy": ["camera=()", "geolocation=()", "microphone=()", "usb=()"],
    "x-content-type-options": ["nosniff"],
    "x-frame-options": ["DENY"],
    "referrer-policy": ["no-referrer"],
    "cache-control": ["no-store"],
}


@pytest.mark.parametrize(
    ("path", "host", "expected"), [("", "127.0.0.1:1", 200), ("nothing", "127.0.0.1:1", 404), ("", "example.com", 403)]
)
def test_every_answer_says_what_a_browser_may_do_with_it(programs, path, host, expected):
    url, _ = address(free_run(programs))
    request = urllib.request.Request(url + path, headers={"Host": host})
    try:
        answer = urllib.request.urlopen(request, timeout=PATIENCE_S)
    except urllib.error.HTTPError as error:
        answer = error
    with answer:
        assert answer.status == expected
        for name, parts in HEADERS.items():
            assert all(part in answer.headers[name] for part in parts), (name, answer.headers[name])


def test_a_port_in_use_is_said(programs):
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        run = programs.resonarm("run", "--mode", "free", "--live", f"127.0.0.1:{port}")
        assert run.wait() == 3
        assert run.stderr == (
            f"resonarm: --live can't listen on 127.0.0.1:{port}: Address already in use (os error 98); "
            "another program uses this port: give another port, or leave it out for a free one\n"
        )


@pytest.mark.parametrize("given", ["nowhere", "127.0.0.1:99999", "http://127.0.0.1"])
def test_what_is_no_address_is_said(programs, given):
    run = programs.resonarm("run", "--mode", "free", "--live", given)
    assert run.wait() == 2
    expected = "expected an address such as 127.0.0.1, 127.0.0.1:8080 or [::1]:8080"
    assert run.stderr == f"resonarm: --live is `{given}`: {expected}\n"


def test_nothing_listens_unless_it_is_asked_for(programs):
    run = programs.resonarm("run", "--mode", "free", "--speed", 1)
    wait_until(lambda: len(list(Path(f"/proc/{run.process.pid}/task").iterdir())) > 1, "the run to begin")
    # State and inode of each TCP socket (proc_net_tcp(5)); 0A is listening.
    sockets = [line.split() for line in Path("/proc/net/tcp").read_text().splitlines()[1:]]
    listening = {words[9] for words in sockets if words[3] == "0A"}
    files = [os.readlink(entry) for entry in Path(f"/proc/{run.process.pid}/fd").iterdir()]
    assert not listening & {name[8:-1] for name in files if name.startswith("socket:[")}
    assert "live view" not in run.stderr


def test_fifty_viewers_and_five_who_read_nothing_are_served_and_the_run_continues(programs):
    """A viewer that does not read loses updates, which are counted, and is dropped; others don't wait for that."""
    run = free_run(programs, "--json")
    url, token = address(run)
    # They connect, and then read nothing, not even the data that the system buffers for them.
    idle = [Viewer(url, max_queue=1, sock=small(url)) for _ in range(5)]
    with ThreadPoolExecutor(50) as pool:
        viewers = list(pool.map(lambda _: Viewer(url, token), range(50)))
        everybody = list(pool.map(lambda viewer: viewer.next("update", lambda now: now["viewers"] == 55), viewers))
        let_go = list(pool.map(lambda viewer: viewer.next("update", lambda now: now["viewers"] == 50), viewers))
    assert len(everybody) == len(let_go) == 50 and len(idle) == 5
    viewers[0].next("update", lambda update: update["lost_updates"] > 5)
    assert viewers[0].ask("disarm") == {"kind": "taken"}
    said = run.result()
    assert said["samples"] > let_go[0]["sample"] and said["outcome"] == "disarmed"


def small(url):
    """A connection whose system buffers little unread data."""
    host, port = url.removeprefix("http://").rstrip("/").split(":")
    raw = socket.socket()
    raw.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    raw.connect((host, int(port)))
    return raw


def test_who_comes_late_is_told_what_was(programs):
    url, _ = address(free_run(programs))
    first = Viewer(url)
    first.next("update", lambda update: update["sample"] > 3000)
    late = Viewer(url)
    assert late.next("state")["state"] == "operational"
    assert late.next("event")["name"].startswith("state.")
    kept = late.next("update")
    assert len(kept["stretches"]) > 200 and np.all(np.diff(kept["stretches"]) == 10)
    # As many as a spectrum takes, the newest last.
    assert kept["rows"] == 2048 and kept["first"] + kept["rows"] == kept["sample"] + 1


# The topics of recordings, and the structure for 3D views.
TOPICS = {
    "/plant/state", "/plant/command", "/plant/sensors", "/plant/steps", "/plant/samples", "/timing/ticks", "/events",
    "/can/frames", "/structure",
}  # fmt: skip


def streamed(program, subprotocol, *topics, count=200):
    """All that Foxglove's own client received, and of each topic the times, ns, and the messages."""
    environment = os.environ | {"NODE_PATH": str(Path(NODE_MODULES).resolve())}
    url = address(program)[0].replace("http:", "ws:")
    command = ["node", "tests/live/foxglove.js", url, subprotocol, str(count), *topics]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=PATIENCE_S)
    assert done.returncode == 0, done.stderr
    received = json.loads(done.stdout)
    assert (received["subprotocol"], received["errors"]) == (subprotocol, [])
    decode, messages = decoders(received["channels"]), {channel["topic"]: [] for channel in received["channels"]}
    for message in received["messages"]:
        decoded = decode[message["topic"]](base64.b64decode(message["bytes"]))
        messages[message["topic"]].append((int(message["timestamp"]), decoded))
    return received, messages


def check_frames(batches, recording):
    """Holds streamed frames to the recorded ones: the same, of both nodes, without a gap but where a recording is
    played again."""
    series = []
    for frames in (list(unpacked(batch)) for _, batch in batches):
        if series and frames[0].step >= series[-1][-1].step:
            series[-1] += frames
        else:
            series.append(frames)
    for frames in series:
        first = next(place for place, frame in enumerate(recording.frames) if frame == frames[0])
        assert frames == recording.frames[first : first + len(frames)]
    assert {batch.interface for _, batch in batches} == {batch.interface for batch in recording.topics["/can/frames"]}
    every = [frame for frames in series for frame in frames]
    ids = {way: {frame.id for frame in every if frame.direction == way} for way in (RECEIVED, SENT)}
    assert ids[RECEIVED] & COMMANDS and not ids[RECEIVED] & SAMPLES
    assert ids[SENT] >= SAMPLES and not ids[SENT] & COMMANDS


def check_arm(updates, recording, about, start_ns):
    """Compares streamed scenes with the recorded states: base, elbow and tip, their vibration as large as stated."""
    links = about["drawing"]["motion"]["links"]
    angles, length_m = links["angles_rad"], links["lengths_m"]
    for time_ns, update in updates:
        published(SceneUpdate.DESCRIPTOR, update)
        (entity,) = update["entities"]
        assert (entity["id"], entity["frame_id"]) == ("structure", "base")
        assert entity["timestamp"] == {"sec": time_ns // 10**9, "nsec": time_ns % 10**9}
        (pair,) = entity["metadata"]
        alpha = float(pair["value"]) * recording.states[round((time_ns - start_ns) / 1e6), :2]
        assert pair["key"] == "magnification" and float(pair["value"]) >= 1
        first, second = angles[0] + alpha[0], angles[1] + alpha.sum()
        elbow = length_m[0] * np.array([np.cos(first), np.sin(first), 0.0])
        tip = elbow + length_m[1] * np.array([np.cos(second), np.sin(second), 0.0])
        found = np.array([[point[axis] for axis in "xyz"] for point in entity["lines"][0]["points"]])
        assert found == pytest.approx(np.array([np.zeros(3), elbow, tip]), abs=1e-12)


@pytest.mark.parametrize("subprotocol", SUBPROTOCOLS)
def test_the_client_of_foxglove_s_makers_reads_the_stream(programs, tmp_path, subprotocol):
    run = free_run(programs, "--record", tmp_path / "run.mcap")
    viewer = Viewer(*address(run))
    # The loop that takes set-points runs.
    viewer.next("update", lambda update: update["rows"] > 0)
    assert viewer.ask({"set": {"load": 30, "frequency_hz": 18, "phase_deg": 0}}) == {"kind": "taken"}
    received, messages = streamed(run, subprotocol, *(TOPICS - {"/timing/ticks", "/events"}))
    assert received["serverInfo"]["name"].startswith("resonarm ")
    assert set(messages) == TOPICS
    steps = []
    for _, batch in messages["/plant/steps"]:
        steps += range(batch.first_step, batch.first_step + len(batch.alpha1_rad))
        assert batch.dt_s == 1e-3
    assert all(sensors.step % 10 == 0 for _, sensors in messages["/plant/sensors"])
    assert len(steps) > 50 and steps == list(range(steps[0], steps[0] + len(steps)))
    times_ns = [time_ns for time_ns, _ in messages["/plant/state"]]
    assert np.all(np.diff(times_ns) == 10_000_000)
    assert run.stop() == 0
    recording = Recording.whole(tmp_path / "run.mcap")
    check_frames(messages["/can/frames"], recording)
    # The time of sample 0 is when the program began to serve.
    time_ns, batch = messages["/plant/steps"][0]
    check_arm(messages["/structure"], recording, viewer.about, time_ns - 10**6 * batch.first_step)


def test_a_recording_is_streamed_with_its_frames_and_the_structure(programs):
    path = "recordings/lockstep-dwell.mcap"
    replay = programs.resonarm("replay", path, "--live")
    viewer = Viewer(*address(replay))
    # Played to its end, and again from the beginning as often as the client needs.
    with ThreadPoolExecutor(1) as pool:
        client = pool.submit(streamed, replay, SUBPROTOCOLS[0], "/can/frames", "/structure", count=40)
        while not client.done():
            assert viewer.ask("play") == {"kind": "taken"}
            time.sleep(0.1)
        _, messages = client.result()
    recording = Recording.whole(Path(path))
    assert set(messages) == TOPICS
    check_frames(messages["/can/frames"], recording)
    check_arm(messages["/structure"], recording, viewer.about, 0)


def test_another_subprotocol_and_nonsense_from_a_client_are_answered(programs):
    url, _ = address(free_run(programs))
    stream = url.replace("http:", "ws:")
    with pytest.raises(InvalidStatus) as refused:
        connect(stream, subprotocols=["mqtt"], **OPEN).__enter__()
    assert refused.value.response.status_code == 400
    with connect(stream, subprotocols=[SUBPROTOCOLS[0]], **OPEN, origin=url[:-1]) as client:
        assert [json.loads(client.recv(PATIENCE_S))["op"] for _ in range(2)] == ["serverInfo", "advertise"]
        client.send('{"op": "subscribe", "subscriptions": [{"id": 1, "channelId": 99}]}')
        assert json.loads(client.recv(PATIENCE_S)) == {"op": "status", "level": 2, "message": "there is no channel 99"}
        client.send("nonsense")
        assert json.loads(client.recv(PATIENCE_S))["op"] == "status"
        client.send(b"\0")
        assert json.loads(client.recv(PATIENCE_S))["message"] == "resonarm accepts only text messages, got a binary one"
