"""A flood, in a process of its own: python flood.py RATE SECONDS PORT…  Bounded in count and in time."""

import random
import socket
import sys
import time

from pymavlink.dialects.v20 import ardupilotmega as dialect

from wire.frames import Sender

HOST = "127.0.0.1"
SLICE_S = 0.001


def datagrams():
    """Noise, and frames that claim to come from vehicles 1 to 6 and from a ground station."""
    rng = random.Random(1)
    noise = [rng.randbytes(rng.randint(1, 280)) for _ in range(1000)]
    headers = [b"\xfd" + rng.randbytes(rng.randint(9, 40)) for _ in range(500)]
    forged = []
    for system in (*range(1, 7), 255):
        sender = Sender(system, 190 if system == 255 else 1)
        for place in range(100):
            position = dialect.MAVLink_local_position_ned_message(10**9 + place, 1e3, 1e3, 0, 9, 9, 9)
            beat = dialect.MAVLink_heartbeat_message(2, 12, 0, 0, 4, 3)
            forged += [sender.pack(position), sender.pack(beat)]
    mixed = noise + headers + forged
    rng.shuffle(mixed)
    return mixed


def flood(rate, seconds, ports):
    """Send `rate` datagrams a second to the ports in turn; how many were sent, and how long it took."""
    mixed = datagrams()
    sockets = [socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in ports]
    began, sent, total = time.monotonic(), 0, round(rate * seconds)
    while sent < total and time.monotonic() - began < seconds + 1.0:
        due = min(total, round((time.monotonic() - began + SLICE_S) * rate))
        for place in range(sent, due):
            turn = place % len(ports)
            try:
                sockets[turn].sendto(mixed[place % len(mixed)], (HOST, ports[turn]))
            except OSError:  # nobody listens there any more
                continue
        sent = max(sent, due)
        time.sleep(SLICE_S)
    return sent, time.monotonic() - began


if __name__ == "__main__":
    rate, seconds, *ports = map(float, sys.argv[1:])
    count, took_s = flood(rate, seconds, [int(port) for port in ports])
    sys.stdout.write(f"{count} datagrams in {took_s:.2f} s\n")
