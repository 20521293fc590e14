"""The other end of a CANopen network, written by hand from the tables of CiA 301 and CiA 402 on python3-can's raw frames.

It shares no line and no number with hal/canopen or sim_plant/nodes: what both sides agree on is the standard.
"""
import os
import select
import socket
import struct
import threading
import time

import can

TIMEOUT_S = 5.0  # of any answer; only a failing test waits for so long


class Bus:
    """One CAN interface; frames that nobody waited for are kept in `seen`."""

    def __init__(self, channel):
        self.bus = can.Bus(interface="socketcan", channel=channel)
        self.seen = []

    def close(self):
        self.bus.shutdown()

    def send(self, identifier, data=b"", remote=False, length=None):
        self.bus.send(can.Message(arbitration_id=identifier, is_extended_id=False, is_remote_frame=remote,
                                  data=None if remote else bytes(data), dlc=length))

    def flush(self):
        while self.bus.recv(0) is not None:
            pass

    def wait(self, identifier, accept=lambda data: True, timeout=TIMEOUT_S):
        """The data of the next frame with this identifier that `accept` takes; None when there is none in time."""
        end = time.monotonic() + timeout
        while (left := end - time.monotonic()) > 0:
            frame = self.bus.recv(left)
            if frame is None:
                return None
            self.seen.append(frame)
            if frame.arbitration_id == identifier and not frame.is_remote_frame and accept(bytes(frame.data)):
                return bytes(frame.data)
        return None

    def last(self, identifier):
        """The data of the last frame with this identifier that came while waiting for others."""
        return next((bytes(frame.data) for frame in reversed(self.seen) if frame.arbitration_id == identifier), None)


class SdoAbort(Exception):
    def __init__(self, code):
        super().__init__(f"abort code {code:08X}h")
        self.code = code


class Master:
    """Asks one node, as CiA 301, 7.2.4.3 has it."""

    def __init__(self, bus, node):
        self.bus, self.node = bus, node

    def ask(self, request):
        self.bus.send(0x600 + self.node, request)
        answer = self.bus.wait(0x580 + self.node)
        assert answer is not None, f"node {self.node} does not answer {request.hex(' ')}"
        assert len(answer) == 8, answer
        if answer[0] == 0x80:
            raise SdoAbort(struct.unpack_from("<I", answer, 4)[0])
        return answer

    def read(self, index, subindex=0):
        answer = self.ask(struct.pack("<BHB4x", 0x40, index, subindex))
        assert answer[1:4] == struct.pack("<HB", index, subindex), answer
        if answer[0] & 0xE3 == 0x43:
            return answer[4:8 - ((answer[0] >> 2) & 3)]
        assert answer[0] == 0x41, f"{answer[0]:02X}h"
        size, value, toggle = struct.unpack_from("<I", answer, 4)[0], b"", 0
        while True:
            segment = self.ask(bytes([0x60 | toggle]) + bytes(7))
            assert segment[0] & 0xF0 == toggle, f"{segment[0]:02X}h"
            value += segment[1:8 - ((segment[0] >> 1) & 7)]
            toggle ^= 0x10
            if segment[0] & 1:
                assert len(value) == size, (len(value), size)
                return value

    def number(self, index, subindex=0, signed=False):
        return int.from_bytes(self.read(index, subindex), "little", signed=signed)

    def write(self, index, subindex, value, size):
        command = {1: 0x2F, 2: 0x2B, 3: 0x27, 4: 0x23}[size]
        data = (value & (1 << 8 * size) - 1).to_bytes(size, "little").ljust(4, b"\0")
        answer = self.ask(struct.pack("<BHB", command, index, subindex) + data)
        assert answer[:4] == struct.pack("<BHB", 0x60, index, subindex), answer

    def write_segmented(self, index, subindex, value, size_stated=True):
        answer = self.ask(struct.pack("<BHBI", 0x21 if size_stated else 0x20, index, subindex, len(value) if size_stated else 0))
        assert answer[0] == 0x60, answer
        toggle = 0
        while True:
            part, value = value[:7], value[7:]
            answer = self.ask(bytes([toggle | (7 - len(part)) << 1 | (not value)]) + part.ljust(7, b"\0"))
            assert answer[0] == 0x20 | toggle, answer
            toggle ^= 0x10
            if not value:
                return


class Drive:
    """A CiA 402 drive in cyclic synchronous torque mode, as a slave of whoever comes."""

    def __init__(self, node, rated_torque_mnm, position=0):
        self.node, self.position, self.rated = node, position, rated_torque_mnm
        self.silent = False            # sends no heartbeats
        self.refuses = {}              # (index, subindex): abort code of a download
        self.puts_numbers_into_segments = False
        self.power_on()

    def power_on(self):
        n = self.node
        self.objects = {
            (0x1000, 0): (4, 0x00020192), (0x1001, 0): (1, 0), (0x1005, 0): (4, 0x80), (0x1016, 0): (1, 1), (0x1016, 1): (4, 0),
            (0x1017, 0): (2, 0), (0x1018, 0): (1, 2), (0x1018, 1): (4, 0x2FC), (0x1018, 2): (4, 7),
            (0x6007, 0): (2, 1), (0x6040, 0): (2, 0), (0x6041, 0): (2, 0), (0x605A, 0): (2, 2), (0x605E, 0): (2, 2),
            (0x6060, 0): (1, 0), (0x6061, 0): (1, 0), (0x6064, 0): (4, self.position), (0x6071, 0): (2, 0),
            (0x6072, 0): (2, 1000), (0x6076, 0): (4, self.rated), (0x6077, 0): (2, 0),
        }
        for communication, mapping, identifier in ((0x1400, 0x1600, 0x200), (0x1401, 0x1601, 0x300), (0x1800, 0x1A00, 0x180)):
            self.objects[communication, 0] = (1, 5)
            self.objects[communication, 1] = (4, 0x80000000 | identifier + n)
            self.objects[communication, 2] = (1, 255)
            self.objects[communication, 5] = (2, 0)
            self.objects[mapping, 0] = (1, 0)
            for place in range(1, 9):
                self.objects[mapping, place] = (4, 0)
        self.nmt = 0x7F
        self.state = "switch on disabled"
        self.segment = None
        self.pending = {}
        self.next_heartbeat = 0.0
        self.boots = True

    STATUS = {"switch on disabled": 0x0250, "ready": 0x0231, "switched on": 0x0233, "enabled": 0x0237, "quick stop": 0x0217, "fault": 0x0218}

    def get(self, index, subindex=0):
        return self.objects[index, subindex][1]

    def put(self, index, subindex, value):
        size = self.objects[index, subindex][0]
        self.objects[index, subindex] = (size, value & (1 << 8 * size) - 1)

    def mapped(self, mapping):
        return [(entry >> 16, entry >> 8 & 0xFF, (entry & 0xFF) // 8)
                for entry in (self.get(mapping, place) for place in range(1, self.get(mapping) + 1))]

    def control(self, word):
        if self.state == "fault":
            if word & 0x80:
                self.state = "switch on disabled"
        elif word & 0x02 == 0:
            self.state = "switch on disabled"
        elif word & 0x06 == 0x02:
            self.state = "quick stop" if self.state == "enabled" else "switch on disabled"
        elif word & 0x07 == 0x06:
            self.state = "ready" if self.state != "quick stop" else self.state
        elif word & 0x0F == 0x07 and self.state in ("ready", "switched on", "enabled"):
            self.state = "switched on"
        elif word & 0x0F == 0x0F and self.state in ("switched on", "enabled"):
            self.state = "enabled"

    def sdo(self, data):
        """The answer to one request."""
        index, subindex = struct.unpack_from("<HB", data, 1)
        abort = lambda code: struct.pack("<BHBI", 0x80, index, subindex, code)
        specifier = data[0] >> 5
        if specifier == 3 and self.segment is not None:
            value, self.segment = self.segment, None
            return bytes([(7 - len(value)) << 1 | 1]) + value.ljust(7, b"\0")
        if specifier not in (1, 2):
            return abort(0x05040001) if specifier != 4 else None
        if (index, subindex) not in self.objects:
            return abort(0x06020000)
        size, value = self.objects[index, subindex]
        if specifier == 2:
            if self.puts_numbers_into_segments:
                self.segment = value.to_bytes(size, "little")
                return struct.pack("<BHBI", 0x41, index, subindex, size)
            return struct.pack("<BHBI", 0x43 | (4 - size) << 2, index, subindex, value)
        if (index, subindex) in self.refuses:
            return abort(self.refuses[index, subindex])
        if data[0] != 0x23 | (4 - size) << 2:
            return abort(0x06070010)
        self.put(index, subindex, int.from_bytes(data[4:4 + size], "little"))
        if index == 0x6060:
            self.put(0x6061, 0, self.get(0x6060))
        return struct.pack("<BHB4x", 0x60, index, subindex)

    def receive(self, identifier, data, send):
        if identifier == 0:
            if data[1] in (0, self.node):
                self.nmt = {0x01: 0x05, 0x02: 0x04, 0x80: 0x7F}.get(data[0], self.nmt)
                if data[0] in (0x81, 0x82):
                    self.power_on()
        elif identifier == 0x600 + self.node and self.nmt != 0x04:
            if (answer := self.sdo(data)) is not None:
                send(0x580 + self.node, answer)
        elif self.nmt == 0x05:
            for communication, mapping in ((0x1400, 0x1600), (0x1401, 0x1601)):
                if identifier == self.get(communication, 1):
                    self.pending[mapping] = data
                    if self.get(communication, 2) > 240:
                        self.apply(mapping)
            if identifier == self.get(0x1005):
                self.put(0x6041, 0, self.STATUS[self.state])
                if self.get(0x1800, 1) & 0x80000000 == 0 and self.get(0x1800, 2) <= 240:
                    frame = b"".join(self.get(i, s).to_bytes(size, "little") for i, s, size in self.mapped(0x1A00))
                    send(self.get(0x1800, 1) & 0x7FF, frame)
                self.apply(0x1600)

    def apply(self, mapping):
        data, offset = self.pending.pop(mapping, b""), 0
        for index, subindex, size in self.mapped(mapping):
            if data and index >= 0x20:
                self.put(index, subindex, int.from_bytes(data[offset:offset + size], "little"))
                if index == 0x6040:
                    self.control(self.get(0x6040))
            offset += size

    def advance(self, now, send):
        if self.boots:
            self.boots = False
            send(0x700 + self.node, b"\0")
        period = self.get(0x1017) / 1000.0
        if period > 0 and now >= self.next_heartbeat and not self.silent:
            send(0x700 + self.node, bytes([self.nmt]))
            self.next_heartbeat = now + period


class Machine:
    """Drives on one bus and a silent but present force sensor (ATI Net F/T on CAN) on another, in a thread of their own."""

    def __init__(self, drives_channel, sensor_channel, drives, sensor_base):
        self.drives, self.sensor_base = drives, sensor_base
        self.buses = [can.Bus(interface="socketcan", channel=c) for c in (drives_channel, sensor_channel)]
        self.stopped = threading.Event()
        self.failure = None
        self.thread = threading.Thread(target=self.run)
        self.thread.start()

    def close(self):
        self.stopped.set()
        self.thread.join()
        for bus in self.buses:
            bus.shutdown()
        if self.failure is not None:
            raise self.failure

    def run(self):
        # One processor is shared with the master, whose programs would keep these drives from answering in time.
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(60))
        try:
            while not self.stopped.is_set():
                self.step()
        except BaseException as failure:  # shown by close(): a dead thread would be a puzzle
            self.failure = failure

    # On python3-can's sockets, but with struct can_frame of linux/can.h: its Message costs more time than this processor has.
    FRAME = struct.Struct("=IB3x8s")

    @classmethod
    def send(cls, bus, identifier, data):
        bus.socket.send(cls.FRAME.pack(identifier, len(data), data))

    @classmethod
    def receive(cls, bus):
        while True:
            try:
                identifier, length, data = cls.FRAME.unpack(bus.socket.recv(cls.FRAME.size, socket.MSG_DONTWAIT))
            except BlockingIOError:
                return
            if identifier <= 0x7FF:  # no flag: a data frame with 11 bits
                yield identifier, data[:length]

    def step(self):
        drives, sensor = self.buses
        send = lambda identifier, data: self.send(drives, identifier, data)
        ready = select.select(self.buses, [], [], 0.01)[0]
        for identifier, data in self.receive(drives) if drives in ready else ():
            for drive in self.drives:
                drive.receive(identifier, data, send)
        now = time.monotonic()
        for drive in self.drives:
            drive.advance(now, send)
        for identifier, data in self.receive(sensor) if sensor in ready else ():
            if identifier == self.sensor_base and data == b"\x02":
                for offset in (5, 6):
                    self.send(sensor, self.sensor_base + offset, bytes(8))
