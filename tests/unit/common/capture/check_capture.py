"""Reads an example capture with nothing but the MCAP and XCDR2 documents, and compares it with the table written beside it."""
import csv
import struct
import subprocess
import sys
import tempfile
import zlib
from pathlib import Path

MAGIC = b"\x89MCAP0\r\n"


class Bytes:
    def __init__(self, data):
        self.data, self.at = data, 0

    def take(self, count):
        assert self.at + count <= len(self.data), "record too short"
        self.at += count
        return self.data[self.at - count : self.at]

    def get(self, form):
        values = struct.unpack("<" + form, self.take(struct.calcsize("<" + form)))
        return values[0] if len(values) == 1 else values

    def text(self):
        return self.take(self.get("I")).decode()

    def left(self):
        return len(self.data) - self.at


def records(data, base=0):
    stream = Bytes(data)
    while stream.left():
        start = base + stream.at
        opcode = stream.get("B")
        yield start, opcode, stream.take(stream.get("Q"))


class Xcdr2:
    """Appendable structs: a delimiter before each; 8-byte values are aligned to 4."""

    def __init__(self, cdr):
        assert cdr[:2] == b"\x00\x09", "not delimited XCDR2, little endian"
        self.body = Bytes(cdr[4 : len(cdr) - (cdr[3] & 3)])

    def get(self, form):
        for letter in form:
            self.body.at += -self.body.at % min(4, struct.calcsize(letter))
            yield self.body.get(letter)

    def one(self, form):
        return next(self.get(form))


def check(path, table):
    data = path.read_bytes()
    assert data.startswith(MAGIC) and data.endswith(MAGIC)
    foot = Bytes(data[-8 - 20 : -8])
    assert data[-8 - 29] == 2
    summary_start, offsets_start, summary_crc = foot.get("QQI")
    assert zlib.crc32(data[summary_start : len(data) - 12]) == summary_crc, "summary checksum"
    assert zlib.crc32(data[: summary_start - 13]) == struct.unpack("<I", data[summary_start - 4 : summary_start])[0], "data checksum"

    channels, schemas, chunks, stats = {}, {}, [], None
    groups = {}
    for start, opcode, content in records(data[summary_start : len(data) - 8 - 29], summary_start):
        record = Bytes(content)
        groups.setdefault(opcode, []).append((start, start + 9 + len(content)))
        if opcode == 3:
            number = record.get("H")
            schemas[number] = (record.text(), record.text(), record.text())
        elif opcode == 4:
            number, schema = record.get("HH")
            channels[number] = (schema, record.text(), record.text())
        elif opcode == 8:
            first, last, offset, length = record.get("QQQQ")
            indexes = Bytes(record.take(record.get("I")))
            where = dict(indexes.get("HQ") for _ in range(indexes.left() // 10))
            chunks.append((first, last, offset, length, where))
        elif opcode == 11:
            stats = record.get("QHIIIIQQ")
        elif opcode == 14:
            kind, begin, length = record.get("BQQ")
            assert (begin, begin + length) == (groups[kind][0][0], groups[kind][-1][1]), "summary offset"
    assert groups[14][0][0] == offsets_start
    assert all(encoding == "omgidl" and "struct " + name.split("::")[-1] in text for name, encoding, text in schemas.values())
    assert all(encoding == "cdr" for _, _, encoding in channels.values())
    assert len(chunks) == stats[5] > 3

    rows = iter(table)
    total = compared = 0
    for first, last, offset, length, where in chunks:
        assert data[offset] == 6
        chunk = Bytes(data[offset + 9 : offset + length])
        assert chunk.get("QQ") == (first, last) and last - first <= 250_000_000
        size, crc = chunk.get("QI")
        assert chunk.text() == "" and chunk.get("Q") == size
        body = chunk.take(size)
        assert zlib.crc32(body) == crc, "chunk checksum"
        by_channel = {}
        for start, opcode, content in records(body):
            assert opcode == 5
            message = Bytes(content)
            channel, sequence, log_time, publish_time = message.get("HIQQ")
            by_channel.setdefault(channel, []).append((log_time, start))
            total += 1
            if channels[channel][1] == "rig/samples":
                compare_sample(message.take(message.left()), next(rows))
                compared += 1
        for channel, at in where.items():
            assert data[at] == 7
            index = Bytes(data[at + 9 :])
            number, length = index.get("HI")
            entries = [index.get("QQ") for _ in range(length // 16)]
            assert number == channel and entries == by_channel[channel], "message index"
        assert set(where) == set(by_channel)
    assert total == stats[0]
    assert next(rows, None) is None and compared == 2000, compared


def compare_sample(cdr, row):
    sample = Xcdr2(cdr)
    sample.one("I")
    values = list(sample.get("Qq" + "BBBB" + "I" + "i" * 4 + "d" * (4 + 4 + 3 * 6 + 2) + "Iff" + "d" * (3 * 3 + 1) + "BI"))
    values[-2:] = values[-1], values[-2]  # the table has contacts before status
    row = list(row.values())
    assert len(row) == len(values) and sample.body.left() == 0
    assert row[2] == "Position" and values[2] == 3
    singles = slice(len(row) - 14, len(row) - 12)  # wakeup_late_us, tick_us
    for value, text in zip(values[:2] + values[4 : singles.start] + values[singles.stop :], row[:2] + row[4 : singles.start] + row[singles.stop :]):
        assert value == float(text), (value, text)
    for value, text in zip(values[singles], row[singles]):
        assert struct.pack("<f", float(text)) == struct.pack("<f", value), (value, text)


with tempfile.TemporaryDirectory() as folder:
    subprocess.run([sys.argv[1], folder], check=True)
    with open(Path(folder) / "example.csv", newline="") as file:
        check(Path(folder) / "example.mcap", list(csv.DictReader(file)))
