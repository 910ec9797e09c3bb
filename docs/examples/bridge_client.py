"""Drives the ego of a run from another process: brakes for what is near ahead. Needs osi-python.

XOSC_BRIDGE_TOKEN=... python docs/examples/bridge_client.py 48100
"""

import json
import math
import os
import socket
import struct
import sys
import time

from osi3.osi_groundtruth_pb2 import GroundTruth


def receive(connection):
    """Return the next message, which its length precedes; end the program after the run."""

    def exactly(count):
        data = b""
        while len(data) < count:
            data += connection.recv(count - len(data)) or sys.exit()  # closed: the run is over
        return data

    return exactly(struct.unpack(">I", exactly(4))[0])


def connect(port):
    while True:  # until the run has begun
        try:
            return socket.create_connection(("127.0.0.1", port))
        except ConnectionRefusedError:
            time.sleep(0.05)


def send(connection, message):
    body = json.dumps(message).encode()
    connection.sendall(struct.pack(">I", len(body)) + body)


connection = connect(int(sys.argv[1]))
send(connection, {"token": os.environ["XOSC_BRIDGE_TOKEN"]})
print(json.loads(receive(connection)))
while True:
    step, truth = json.loads(receive(connection)), GroundTruth.FromString(receive(connection))
    ego = next(each for each in truth.moving_object if each.id == truth.host_vehicle_id).base
    speed, c, s = (
        math.hypot(ego.velocity.x, ego.velocity.y),
        math.cos(ego.orientation.yaw),
        math.sin(ego.orientation.yaw),
    )
    answer = {
        "acceleration": min(max(step["target_speed"] - speed, -2.0), 2.0),
        "reason": "to the target speed",
    }
    for each in truth.moving_object:
        dx, dy = each.base.position.x - ego.position.x, each.base.position.y - ego.position.y
        ahead, aside = dx * c + dy * s, dy * c - dx * s
        if 0.0 < ahead < 10.0 + 2.0 * speed and abs(aside) < 2.0:
            answer = {"acceleration": -6.0, "reason": f"somebody is {ahead:.1f} m ahead"}
    send(connection, answer)
