"""The whole job through Debian's python3-jsonrpclib-pelix, a JSON-RPC client that knows nothing of us.

/usr/bin/python3 third_party_client.py http://127.0.0.1:PORT/rpc TOKEN [PROTOCOL]
"""
import json
import sys
import time

from jsonrpclib import MultiCall, ProtocolError, ServerProxy
from jsonrpclib.config import Config

url, token = sys.argv[1:3]
protocol = sys.argv[3] if len(sys.argv) > 3 else "stage-stroke-against-rate"
server = ServerProxy(url, headers={"Authorization": "Bearer " + token},
                     config=Config(content_type="application/json"))

assert isinstance(server.system.info(), dict)
# A name that begins with "rpc." is reserved, but reads as any other here.
assert any(m["name"] == "run.start" for m in getattr(server, "rpc.discover")()["methods"])

listed = server.protocol.list()
listed = listed.get("protocols", listed) if isinstance(listed, dict) else listed
protocols = [p["name"] if isinstance(p, dict) else p for p in listed]
assert protocol in protocols, protocols

invalid = server.protocol.validate(protocol={"format": "ferrobench-protocol", "version": 1, "segments": 3})
assert invalid["valid"] is False and all("path" in p for p in invalid["problems"]), invalid

server.run.start(protocol=protocol, device="virtual", fast=True)
for _ in range(600):
    status = server.run.status()
    if status["state"] in ("complete", "aborted"):
        break
    time.sleep(0.1)
assert status["state"] == "complete", status

recorded = server.recording.list()
recordings = recorded.get("recordings", recorded) if isinstance(recorded, dict) else recorded
assert recordings
name = status.get("recording") or recordings[-1]["name"]
assert len(json.dumps(server.recording.report(name=name, format="json"))) > 100

try:
    getattr(server, "no.such")()
    raise SystemExit("a missing method was answered")
except ProtocolError as error:
    assert error.args[0][0] == -32601, error.args

batch = MultiCall(server)
batch.system.info()
batch.run.status()
assert [type(result) for result in batch()] == [dict, dict]

print("ran", protocol + ":", name)
