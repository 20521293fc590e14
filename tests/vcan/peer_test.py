"""An independent CANopen peer on real CAN sockets: as master of our simulated drives, and as drives of our master.

Run inside toolchain/vcan-vm:  peer_test.py PROGRAMS RIG     (a folder of programs, a rig file with vcan0 and vcan1)
"""
import json
import os
import struct
import sys
import tempfile
import time
import unittest

import ours

try:
    from canopen_peer import Bus, Drive, Machine, Master, SdoAbort
except ModuleNotFoundError as missing:
    print(f"peer_test: {missing}: install Debian's python3-can", file=sys.stderr)
    sys.exit(77)

ours.PROGRAMS, RIG = sys.argv[1:3]
DOMAIN = "73"
RATED_MNM = 105  # 0.0525 N m/A at 2 A continuous, as the rig file has it
PEAK_PERMILLE = 5000  # 10 A


class AsMaster(unittest.TestCase):
    """Node 2 of the simulated machine, from its power-on on."""

    node = 2

    @classmethod
    def setUpClass(cls):
        cls.bus = Bus("vcan0")
        cls.plant = ours.Program("trocar-plant", "--rig", RIG)
        cls.plant.wait_for("before scene")
        cls.booted = {frame.arbitration_id: bytes(frame.data) for frame in iter(lambda: cls.bus.bus.recv(1.0), None)}

    @classmethod
    def tearDownClass(cls):
        code = cls.plant.end()
        cls.bus.close()
        assert code == 0, cls.plant.said()

    def setUp(self):
        self.bus.flush()
        self.master = Master(self.bus, self.node)
        self.nmt(0x81)
        self.assertEqual(self.bus.wait(0x700 + self.node), b"\0", "no boot-up message after a node reset")

    def nmt(self, command, node=None):
        self.bus.send(0x000, [command, self.node if node is None else node])

    def aborts(self, code, call, *arguments):
        with self.assertRaises(SdoAbort) as caught:
            call(*arguments)
        self.assertEqual(f"{caught.exception.code:08X}", f"{code:08X}")

    def raw(self, *request):
        return self.master.ask(bytes(request).ljust(8, b"\0"))

    def status(self):
        return self.master.number(0x6041)

    def expect_status(self, pattern, mask=0x006F):
        self.assertEqual(f"{self.status() & mask:04X}", f"{pattern:04X}")

    def control(self, word):
        self.master.write(0x6040, 0, word, 2)

    def map_pdo(self, communication, mapping, identifier, transmission, entries):
        """The procedure of CiA 301, 7.5.2.36."""
        write, read = self.master.write, self.master.number
        write(communication, 1, identifier | 0x80000000, 4)
        write(communication, 2, transmission, 1)
        write(mapping, 0, 0, 1)
        for place, entry in enumerate(entries, 1):
            write(mapping, place, entry, 4)
        write(mapping, 0, len(entries), 1)
        write(communication, 1, identifier, 4)
        self.assertEqual(read(communication, 1), identifier)
        self.assertEqual([read(mapping, place) for place in range(len(entries) + 1)], [len(entries), *entries])

    # --- network management

    def test_every_drive_says_at_power_on_that_it_has_booted(self):
        self.assertEqual(self.booted, {0x701: b"\0", 0x702: b"\0", 0x703: b"\0", 0x704: b"\0"})

    def test_nmt_leads_through_all_states(self):
        self.master.write(0x1017, 0, 20, 2)
        for command, state in ((0x01, 0x05), (0x80, 0x7F), (0x02, 0x04), (0x01, 0x05)):
            self.nmt(command)
            self.assertIsNotNone(self.bus.wait(0x702, lambda data: data == bytes([state])), f"{state:02X}h")
        self.nmt(0x82)
        self.assertIsNotNone(self.bus.wait(0x702, lambda data: data == b"\0"))
        self.assertEqual(self.master.number(0x1017), 0)  # communication objects are those of power-on again

    def test_nmt_to_node_0_is_for_all_and_to_another_node_for_none(self):
        self.nmt(0x82, 0)
        heard = set()
        self.bus.wait(0x7FF, timeout=1.0)
        for frame in self.bus.seen[-40:]:
            if bytes(frame.data) == b"\0":
                heard.add(frame.arbitration_id)
        self.assertEqual(heard, {0x701, 0x702, 0x703, 0x704})
        self.nmt(0x02, 9)
        self.assertEqual(self.master.number(0x1000), 0x00020192)  # not stopped

    def test_stopped_node_answers_no_sdo(self):
        self.nmt(0x02)
        self.bus.send(0x602, struct.pack("<BHB4x", 0x40, 0x1000, 0))
        self.assertIsNone(self.bus.wait(0x582, timeout=0.3))
        self.nmt(0x80)
        self.assertEqual(self.master.number(0x1000), 0x00020192)

    def test_node_guarding_answers_with_an_alternating_bit(self):
        answers = []
        for _ in range(4):
            self.bus.send(0x702, remote=True, length=1)
            answers.append(self.bus.wait(0x702))
        self.assertEqual(answers, [b"\x7f", b"\xff", b"\x7f", b"\xff"])

    # --- objects

    def test_mandatory_objects_and_identity(self):
        read = self.master.number
        self.assertEqual(read(0x1000) & 0xFFFF, 402)
        self.assertEqual(read(0x1001), 0)
        self.assertEqual(read(0x1003), 0)
        self.assertEqual(read(0x1005), 0x80)
        self.assertEqual(read(0x1006), 0)
        self.assertEqual(read(0x1014), 0x82)
        self.assertEqual(read(0x1018), 4)
        self.assertEqual([read(0x1018, s) for s in range(1, 5)][3], 2)
        self.assertEqual([read(0x1200, s) for s in range(3)], [2, 0x602, 0x582])
        self.assertEqual(read(0x6502), 1 << 9)  # cyclic synchronous torque
        self.assertEqual(read(0x6076), RATED_MNM)

    def test_pdos_at_power_on_are_those_of_cia_402(self):
        read = self.master.number
        for i in range(4):
            off = 0 if i == 0 else 0x80000000
            self.assertEqual(read(0x1400 + i, 1), off | 0x202 + 0x100 * i)
            self.assertEqual(read(0x1800 + i, 1), off | 0x40000000 | 0x182 + 0x100 * i)
            self.assertEqual(read(0x1400 + i, 2), 255)
            self.assertEqual(read(0x1800 + i, 2), 255)
        self.assertEqual([read(0x1600), read(0x1600, 1)], [1, 0x60400010])
        self.assertEqual([read(0x1A00), read(0x1A00, 1)], [1, 0x60410010])

    def test_texts_come_in_segments(self):
        self.assertEqual(self.master.read(0x1008), b"trocar simulated drive")
        self.assertEqual(self.master.read(0x1009), b"simulated")
        self.assertEqual(self.master.read(0x100A), b"1")

    def test_values_go_in_segments(self):
        self.master.write_segmented(0x6403, 0, b"EC-4pole 90 W, 48 V")
        self.assertEqual(self.master.read(0x6403), b"EC-4pole 90 W, 48 V")
        self.master.write_segmented(0x6403, 0, b"a" * 14, size_stated=False)
        self.assertEqual(self.master.read(0x6403), b"a" * 14)
        self.master.write_segmented(0x1017, 0, b"\x00\x00")

    def test_refusals_carry_the_standards_abort_codes(self):
        read, write = self.master.read, self.master.write
        self.aborts(0x06020000, read, 0x2345)
        self.aborts(0x06020000, write, 0x2345, 0, 1, 4)
        self.aborts(0x06090011, read, 0x1018, 5)
        self.aborts(0x06010002, write, 0x1000, 0, 1, 4)
        self.aborts(0x06010002, self.master.write_segmented, 0x1008, 0, b"another name")
        self.aborts(0x06070010, write, 0x1017, 0, 100, 4)
        self.aborts(0x06090030, write, 0x6060, 0, 3, 1)  # profile velocity
        self.aborts(0x06070012, self.master.write_segmented, 0x6403, 0, b"x" * 41)
        self.aborts(0x05040001, self.raw, 0xA0, 0x08, 0x10, 0, 0x7F)                 # block upload
        self.aborts(0x05040001, self.raw, 0xC2, 0x17, 0x10, 0, 2)                    # block download
        self.aborts(0x05040001, self.raw, 0xE0)                                      # no such specifier
        self.aborts(0x05040001, self.raw, 0x60)                                      # a segment of no transfer
        self.raw(0x40, 0x08, 0x10, 0)
        self.aborts(0x05030000, self.raw, 0x70)                                      # toggle bit
        self.raw(0x21, 0x03, 0x64, 0, 8)
        self.raw(0x00, *b"1234567")
        self.aborts(0x05030000, self.raw, 0x01, *b"8")
        self.assertEqual(self.master.number(0x1000), 0x00020192)  # none of it harmed the server

    def test_error_history_begins_empty_and_is_cleared_by_0_only(self):
        self.aborts(0x06090030, self.master.write, 0x1003, 0, 1, 1)
        self.master.write(0x1003, 0, 0, 1)
        self.aborts(0x08000024, self.master.read, 0x1003, 1)

    # --- heartbeats

    def test_heartbeats_come_with_the_period_that_was_written(self):
        self.assertIsNone(self.bus.wait(0x702, timeout=0.3))
        self.master.write(0x1017, 0, 50, 2)
        self.bus.wait(0x702)
        first = time.monotonic()
        for _ in range(10):
            self.assertEqual(self.bus.wait(0x702), b"\x7f")
        # The simulation may be starved, which makes the period longer; shorter it never gets.
        self.assertGreater(time.monotonic() - first, 0.4)
        self.assertLess(time.monotonic() - first, 5.0)
        self.master.write(0x1017, 0, 0, 2)
        self.bus.flush()
        self.assertIsNone(self.bus.wait(0x702, timeout=0.3))

    def test_a_lost_master_is_a_fault_that_a_reset_ends(self):
        write = self.master.write
        write(0x1016, 1, 0x007F0000 | 200, 4)
        write(0x6007, 0, 1, 2)  # fault on a lost connection
        write(0x6060, 0, 10, 1)
        self.nmt(0x01)
        self.bus.send(0x77F, [0x05])
        for word in (0x06, 0x07, 0x0F):
            self.control(word)
        self.expect_status(0x27)
        emergency = self.bus.wait(0x082)
        self.assertEqual(emergency, bytes([0x30, 0x81, 0x11, 0, 0, 0, 0, 0]))  # 8130h, communication error
        self.expect_status(0x08, 0x004F)
        self.assertEqual(self.master.number(0x1001), 0x11)
        self.assertEqual([self.master.number(0x1003), self.master.number(0x1003, 1) & 0xFFFF], [1, 0x8130])
        self.assertEqual(self.master.number(0x603F), 0x8130)
        self.control(0x0F)
        self.expect_status(0x08, 0x004F)  # only the edge of bit 7 leads out
        self.control(0x80)
        self.expect_status(0x40, 0x004F)
        self.assertEqual(self.bus.last(0x082), bytes(8))  # error reset
        self.assertEqual(self.master.number(0x1001), 0)

    # --- process data

    def test_statusword_comes_on_event_and_controlword_is_taken(self):
        self.nmt(0x01)
        self.assertEqual(self.bus.wait(0x182), b"\x50\x02")
        for word, status in ((0x06, 0x31), (0x07, 0x33), (0x0F, 0x37), (0x06, 0x31), (0x00, 0x50)):
            self.bus.send(0x202, [word, 0])
            tpdo = self.bus.wait(0x182, lambda data: data[0] == status)
            self.assertIsNotNone(tpdo, f"controlword {word:04X}h")

    def test_sync_brings_the_remapped_feedback(self):
        self.map_pdo(0x1800, 0x1A00, 0x40000182, 1, [0x60640020, 0x60770010, 0x60410010])
        self.nmt(0x01)
        position = self.master.number(0x6064, signed=True)
        self.bus.send(0x080)
        tpdo = self.bus.wait(0x182)
        self.assertEqual(struct.unpack("<ihH", tpdo), (position, 0, 0x0250))
        # Every third SYNC
        self.nmt(0x80)
        self.map_pdo(0x1800, 0x1A00, 0x40000182, 3, [0x60410010])
        self.nmt(0x01)
        self.bus.seen.clear()
        for _ in range(9):
            self.bus.send(0x080)
        self.master.number(0x1000)  # all of them have been processed
        self.assertEqual(sum(frame.arbitration_id == 0x182 for frame in self.bus.seen), 3)
        self.nmt(0x80)
        self.bus.send(0x080)
        self.assertIsNone(self.bus.wait(0x182, timeout=0.2))  # only while operational

    def test_four_words_in_one_frame_of_which_one_is_its_own(self):
        self.map_pdo(0x1400, 0x1600, 0x200, 1, [0x00030010, 0x60710010, 0x00030010, 0x00030010])
        self.nmt(0x01)
        self.bus.send(0x200, struct.pack("<4h", 111, -222, 333, 444))
        self.assertEqual(self.master.number(0x6071), 0)  # synchronous: not before the SYNC
        self.bus.send(0x080)
        self.assertEqual(self.master.number(0x6071, signed=True), -222)
        self.bus.send(0x200, b"\0\0\0")
        self.assertEqual(self.bus.wait(0x082), bytes([0x10, 0x82, 0x11, 0, 0, 0, 0, 0]))  # 8210h: too short

    def test_mapping_is_refused_out_of_order(self):
        write = self.master.write
        self.aborts(0x08000022, write, 0x1A00, 0, 0, 1)  # the PDO exists
        write(0x1800, 1, 0xC0000182, 4)
        self.aborts(0x08000022, write, 0x1A00, 1, 0x60640020, 4)  # the mapping is in force
        write(0x1A00, 0, 0, 1)
        self.aborts(0x06020000, write, 0x1A00, 1, 0x23450010, 4)
        self.aborts(0x06040041, write, 0x1A00, 1, 0x10000020, 4)
        write(0x1A00, 1, 0x60640020, 4)
        write(0x1A00, 2, 0x60640020, 4)
        write(0x1A00, 3, 0x60410010, 4)
        self.aborts(0x06040042, write, 0x1A00, 0, 3, 1)  # ten bytes

    # --- CiA 402

    def test_states_by_sdo(self):
        self.expect_status(0x40, 0x004F)
        self.control(0x07)
        self.expect_status(0x40, 0x004F)  # not from here
        for word, status in ((0x06, 0x21), (0x07, 0x23), (0x0F, 0x27), (0x07, 0x23), (0x06, 0x21), (0x07, 0x23), (0x0F, 0x27)):
            self.control(word)
            self.expect_status(status)
        self.control(0x00)
        self.expect_status(0x40, 0x004F)

    def test_quick_stop_is_left_by_itself_or_not_as_its_option_says(self):
        for option, then in ((2, 0x40), (6, 0x07)):
            self.nmt(0x80)
            self.control(0x00)
            self.master.write(0x605A, 0, option, 2)
            for word in (0x06, 0x07, 0x0F, 0x02):
                self.control(word)
            self.assertIn(self.status() & 0x6F, (0x07, 0x40, 0x60))
            self.nmt(0x01)
            self.bus.send(0x080)
            self.expect_status(then, 0x004F)
        self.control(0x00)
        self.expect_status(0x40, 0x004F)

    def test_torque_follows_its_mode_and_limit(self):
        write = self.master.write
        self.assertEqual(self.master.number(0x6072), PEAK_PERMILLE)
        self.aborts(0x06090030, write, 0x6072, 0, PEAK_PERMILLE + 1, 2)
        write(0x6060, 0, 10, 1)
        self.assertEqual(self.master.number(0x6061), 10)
        self.nmt(0x01)
        for word in (0x06, 0x07, 0x0F):
            self.control(word)
        before = self.master.number(0x6064, signed=True)
        write(0x6071, 0, 100, 2)
        self.bus.send(0x080)
        end = time.monotonic() + 5
        while abs(self.master.number(0x6064, signed=True) - before) < 20 and time.monotonic() < end:
            pass
        self.assertGreater(self.master.number(0x6064, signed=True), before + 19)  # the machine moves, the way the torque points
        self.assertGreater(self.master.number(0x6077, signed=True), 50)
        self.control(0x00)


class AsDrives(unittest.TestCase):
    """Four drives made here, under our controller."""

    def setUp(self):
        self.drives = [Drive(node, RATED_MNM, position=1000 * node) for node in (1, 2, 3, 4)]
        self.drives[1].puts_numbers_into_segments = True  # a drive may
        self.drives[3].refuses[0x6072, 0] = 0x06090030
        # Python on a kernel whose system calls take 20 us answers a hundred ticks a second.
        with open(RIG) as slow, tempfile.NamedTemporaryFile("w", suffix=".toml", delete=False) as slower:
            slower.write(ours.edited(slow.read(), ("tick_hz = 200.0", "tick_hz = 100.0"), ("feedback_deadline_us = 4000", "feedback_deadline_us = 8000")))
        self.addCleanup(os.remove, slower.name)
        self.machine = Machine("vcan0", "vcan1", self.drives, 0x430)
        self.addCleanup(self.machine.close)
        self.rig = ours.Program("trocar-rig", "--rig", slower.name, "--best-effort", "--domain", DOMAIN)
        self.addCleanup(self.rig.end)
        self.rig.wait_for("DDS domain")

    def ask(self, *arguments):
        return ours.run("trocar", "rig", *arguments, "--domain", DOMAIN)

    def wait_for_status(self, accept, timeout=60.0):
        end = time.monotonic() + timeout
        while True:
            done = self.ask("status", "--json")
            self.assertEqual(done.returncode, 0, done.stderr)
            status = json.loads(done.stdout)
            if accept(status):
                return status
            self.assertLess(time.monotonic(), end, status)
            time.sleep(0.5)

    def wait_until(self, reached):
        end = time.monotonic() + 20
        while not reached():
            self.assertLess(time.monotonic(), end, [drive.state for drive in self.drives])
            time.sleep(0.02)

    def test_our_master_leads_them_to_operation_enabled_and_notices_what_goes_wrong(self):
        # One refuses a setting: the drive, the object and the reason are named, and it is tried again.
        self.wait_for_status(lambda s: all(word in s["text"] for word in ("node 4", "6072h", "06090030")))
        self.drives[3].refuses.clear()

        self.wait_for_status(lambda s: s["mode"] == "Ready")
        for i, drive in enumerate(self.drives):
            self.assertEqual(drive.nmt, 0x05)
            self.assertEqual(drive.mapped(0x1A00), [(0x6064, 0, 4), (0x6077, 0, 2), (0x6041, 0, 2)])
            self.assertEqual(drive.mapped(0x1600)[i], (0x6071, 0, 2))
            self.assertEqual(drive.get(0x1400, 1), 0x200)
            self.assertEqual(drive.get(0x6061), 10)
            self.assertGreater(drive.get(0x1017), 0)
            self.assertEqual(drive.get(0x1016, 1) >> 16, 127)
            self.assertEqual(drive.state, "switch on disabled")  # nobody is armed

        self.wait_until(lambda: self.ask("home").returncode == 0)  # once the velocities that its filters began with have died out
        armed = ours.Program("trocar", "rig", "arm", "--domain", DOMAIN)
        self.addCleanup(armed.end)
        armed.wait_for("armed")
        self.wait_until(lambda: all(drive.state == "enabled" for drive in self.drives))

        self.drives[2].silent = True
        status = self.wait_for_status(lambda s: s["mode"] == "Fault")
        self.assertEqual(status["fault"], "HeartbeatLost")
        self.wait_until(lambda: all(drive.state != "enabled" for drive in self.drives[:2] + self.drives[3:]))


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1] + sys.argv[3:])
