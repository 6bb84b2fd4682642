"""SOEM, by pysoem: scan, objects, mapping, distributed clocks, OP, process data. Arguments: interface, seconds."""

import struct
import sys
import time

import pysoem

from walk import Walk

master = pysoem.Master()
master.open(sys.argv[1])
count = master.config_init()
assert count > 0, "no slaves"
axes_of = []
for slave in master.slaves:
    assert slave.name.startswith("FS-VD"), slave.name
    assert slave.sdo_read(0x1018, 1) == struct.pack("<I", slave.man)
    assert slave.sdo_read(0x1008, 0).startswith(b"Flexspline virtual drive")
    objects = {entry.index: entry for entry in slave.od}
    axes = sum(0x6040 + 0x800 * axis in objects for axis in range(8))
    axes_of.append(axes)
    assert objects[0x6040].name == b"Controlword", objects[0x6040].name
    entries = objects[0x1018].entries
    assert [entry.bit_length for entry in entries] == [8, 32, 32, 32, 32]
    # complete access, longer than four bytes
    mapping = slave.sdo_read(0x1600, 0, ca=True)
    assert mapping[0] == 7 and mapping[2:6] == struct.pack("<I", 0x60400010), mapping
    slave.sdo_write(0x6065, 0, struct.pack("<I", 0xFFFFFFFF))
    slave.sdo_write(0x1C32, 1, struct.pack("<H", 2))
    try:
        slave.sdo_write(0x6041, 0, b"\0\0")
        raise AssertionError("a read-only object was written")
    except pysoem.SdoError as error:
        assert error.abort_code == 0x06010002, hex(error.abort_code)
master.config_map()
assert master.config_dc()
for slave in master.slaves:
    slave.dc_sync(True, 1_000_000)
assert master.state_check(pysoem.SAFEOP_STATE, 500_000) == pysoem.SAFEOP_STATE
master.send_processdata()
assert master.receive_processdata(20_000) == master.expected_wkc
begun = time.perf_counter()
master.state = pysoem.OP_STATE
master.write_state()
while master.state_check(pysoem.OP_STATE, 2_000) != pysoem.OP_STATE:
    master.send_processdata()
    master.receive_processdata(20_000)
    assert time.perf_counter() - begun < 5, "not in OP"

walk = Walk(axes_of)
cycles, short, late = 0, 0, 0
end = time.perf_counter() + float(sys.argv[2])
while time.perf_counter() < end:
    for position, slave in enumerate(master.slaves):
        slave.output = walk.outputs(position, slave.input)
    master.send_processdata()
    counter = master.receive_processdata(20_000)
    # -1: no frame in time, which a busy machine does
    late += counter == -1
    short += counter not in (-1, master.expected_wkc)
    cycles += 1
    time.sleep(0.0005)
print(f"SOEM, pysoem {pysoem.__version__}: {count} slaves, {cycles} cycles, "
      f"{short} with a wrong working counter, {late} later than 20 ms")
assert short == 0
assert cycles > 100 and late < cycles / 100
walk.check(cycles)
master.state = pysoem.INIT_STATE
master.write_state()
master.close()
