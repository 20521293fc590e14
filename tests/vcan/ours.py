"""Our programs, as the tests of this folder start them."""
import os
import signal
import subprocess
import tempfile
import time

PROGRAMS = ""  # their folder; each test sets it


def run(name, *arguments):
    return subprocess.run([os.path.join(PROGRAMS, name), *arguments], capture_output=True, text=True)


def edited(text, *edits):
    for old, new in edits:
        assert old in text, old
        text = text.replace(old, new)
    return text


class Program:
    """One of ours, with what it says in a file."""

    def __init__(self, name, *arguments, prefix=()):
        self.log = tempfile.NamedTemporaryFile("w+")
        self.process = subprocess.Popen([*prefix, os.path.join(PROGRAMS, name), *arguments], stdout=self.log, stderr=subprocess.STDOUT)

    def said(self):
        with open(self.log.name) as log:
            return log.read()

    def wait_for(self, text, timeout=30.0):
        end = time.monotonic() + timeout
        while text not in self.said():
            assert self.process.poll() is None and time.monotonic() < end, self.said()
            time.sleep(0.02)

    def end(self):
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGTERM)
        return self.process.wait(30)
