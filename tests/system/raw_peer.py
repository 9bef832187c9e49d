#!/usr/bin/env python3
"""Peers without keys that speak ZMTP 3.1 [ZeroMQ RFC 37] over sockets of their own, and so can say
what no library would. Except for `fill`, they go on until they are killed, on a new connection
whenever they are cut off.

    raw_peer.py pour FLAGS SIZE ENDPOINT...  sends frames with these flags and so many bytes for ever
    raw_peer.py fill SIZE ENDPOINT           opens 30 connections, and sends all but the last byte of
                                             a frame of the handshake on each; waits to be killed
    raw_peer.py crowd ENDPOINT ENDPOINT      holds 600 connections, which say nothing or fill a frame
                                             of the handshake
    raw_peer.py ask WORKER ENDPOINT          is ten workers that ask for the definition of a campaign
                                             300 times and read no answer; says the first words of
                                             the program WORKER
"""

import contextlib
import os
import socket
import struct
import subprocess
import sys
import threading
import time

MORE, COMMAND = 1, 4  # Flags of frames.
PATIENCE_S = 5  # So that a test ends whatever the other end does.


def head_of_large(flags, size):
    """The head of a frame of 256 bytes or more."""
    return struct.pack(">BQ", flags | 2, size)


def frame(flags, body):
    head = bytes([flags, len(body)]) if len(body) < 256 else head_of_large(flags, len(body))
    return head + body


class RawPeer:
    """A connection; its methods raise OSError when they are cut off."""

    def __init__(self, endpoint=None, accepted=None):
        self.socket = accepted or socket.create_connection(
            ("127.0.0.1", int(endpoint.rpartition(":")[2])), timeout=PATIENCE_S)

    def greet(self, mechanism):
        self.send((b"\xff" + bytes(8) + b"\x7f\x03\x01" + mechanism).ljust(64, b"\0"))

    def introduce(self, kind=b"DEALER"):
        """The whole handshake without keys."""
        self.greet(b"NULL")
        self.send(frame(COMMAND, b"\x05READY\x0bSocket-Type" + struct.pack(">I", len(kind)) + kind))
        self._read(64)
        self.receive()

    def send(self, data):
        self.socket.sendall(data)

    def receive(self):
        """Flags and body of the next frame."""
        flags, size = self._read(2)
        if flags & 2:
            size = int.from_bytes(bytes([size]) + self._read(7), "big")
        return flags, self._read(size)

    def message(self):
        """The next frame that is no command."""
        while True:
            flags, body = self.receive()
            if not flags & COMMAND:
                return body

    def _read(self, size):
        data = b""
        while len(data) < size:
            part = self.socket.recv(size - len(data))
            if not part:
                raise ConnectionError("closed")
            data += part
        return data

    def reset(self):
        """Hangs up so that the other end sees an error."""
        self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        self.socket.close()


def again_and_again(act, endpoint):
    while True:
        with contextlib.suppress(OSError):
            peer = RawPeer(endpoint)
            try:
                act(peer)
            finally:
                peer.reset()


def pour(peer, flags, size):
    peer.introduce()
    peer.socket.settimeout(None)
    data = frame(flags, b"x" * size) * max(1, 60_000 // size)
    while True:
        peer.send(data)


def fill(endpoint, size, count=30):
    peers = [RawPeer(endpoint) for _ in range(count)]
    for peer in peers:
        with contextlib.suppress(OSError):
            peer.greet(b"CURVE")
            peer.send(head_of_large(COMMAND, size))
            peer.send(b"x" * (size - 1))
    return peers


def crowd(endpoints):
    while True:
        peers = []
        with contextlib.suppress(OSError):
            for i in range(600):
                peers.append(RawPeer(endpoints[i % 2]))
                if i % 3:
                    peers[-1].greet(b"CURVE")
                if i % 3 == 1:
                    peers[-1].send(head_of_large(COMMAND, 1 << 20))
        for peer in peers:
            peer.socket.close()


def varint(value):
    data = b""
    while value > 127:
        data += bytes([value & 127 | 128])
        value >>= 7
    return data + bytes([value])


def fields(message):
    """The fields of a message of protobuf by their numbers, the last of each."""
    found, at = {}, 0

    def number():
        nonlocal at
        value = shift = 0
        while True:
            byte = message[at]
            at += 1
            value |= (byte & 127) << shift
            shift += 7
            if byte < 128:
                return value

    while at < len(message):
        key = number()
        if key & 7 == 0:
            found[key >> 3] = number()
            continue
        size = {1: 8, 5: 4}.get(key & 7) or number()
        found[key >> 3] = message[at:at + size]
        at += size
    return found


def first_words(worker):
    """The envelope with which a worker begins."""
    with socket.create_server(("127.0.0.1", 0)) as listener:
        listener.settimeout(20)
        endpoint = f"tcp://127.0.0.1:{listener.getsockname()[1]}"
        with subprocess.Popen([worker, "--connect", endpoint, "--no-supervisor"],
                              stderr=subprocess.DEVNULL) as process:
            peer = RawPeer(accepted=listener.accept()[0])
            peer.introduce(b"ROUTER")
            envelope = fields(peer.message())
            process.kill()
    return envelope


def ask(peer, hello, session):
    """Numbers of fields: see proto/proofmass.proto."""
    peer.introduce()
    epoch, sequence = bytes(8), 0

    def say(number, body):
        nonlocal sequence
        sequence += 1
        peer.send(frame(0, b"\x08" + varint(hello[1]) + b"\x11" + struct.pack("<Q", session) + b"\x19" + epoch
                        + b"\x20" + varint(sequence) + varint(number << 3 | 2) + varint(len(body)) + body))

    say(5, hello[5])
    while True:
        answer = fields(peer.message())
        if 7 in answer:
            raise ConnectionError("rejected")
        if 6 in answer:  # Welcome: a heartbeat that wants a run.
            epoch = answer[3]
            say(16, b"\x08\x01")
        if 11 in answer:  # A lease: requests for its campaign.
            for _ in range(300):
                say(8, b"\x09" + fields(answer[11])[1])
            break
    while peer.socket.fileno() >= 0:  # Until it is cut off, which a further word tells.
        time.sleep(0.05)
        say(16, b"")


def main():
    action, *arguments = sys.argv[1:]
    if action == "crowd":
        crowd(arguments)
    if action == "fill":
        peers = fill(arguments[1], int(arguments[0]))
        print(len(peers), flush=True)
        while True:
            time.sleep(1000)
    if action == "pour":
        flags, size = map(int, arguments[:2])
        acts = [(lambda peer: pour(peer, flags, size), endpoint) for endpoint in arguments[2:]]
    else:
        hello = first_words(arguments[0])
        acts = [(lambda peer, session=5001 + i: ask(peer, hello, session), arguments[1])
                for i in range(10)]
    for act in acts:
        threading.Thread(target=again_and_again, args=act, daemon=True).start()
    while os.getppid() != 1:
        time.sleep(0.1)


if __name__ == "__main__":
    main()
