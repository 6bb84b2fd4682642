"""KickCAT: scan, objects, mapping, OP, process data. Arguments: interface, seconds."""

import importlib.metadata
import sys
import time
from datetime import timedelta

import kickcat

from walk import Walk

# A broadcast of this master always waits for its time-out; it must be shorter than the watchdog of 100 ms.
LINK = timedelta(milliseconds=20)
WAIT = timedelta(seconds=2)

link = kickcat.create_link(sys.argv[1], "")
link.set_timeout(LINK)
bus = kickcat.Bus(link)
bus.init(timedelta(milliseconds=100))
slaves = bus.slaves()
assert slaves, "no slaves"


def read(slave, index, sub_index, access=kickcat.Access.PARTIAL):
    return bus.read_sdo(slave, index, sub_index, access, 128, WAIT)


axes_of = []
for slave in slaves:
    assert read(slave, 0x1008, 0).startswith(b"Flexspline virtual drive")
    assert len(read(slave, 0x1018, 1, kickcat.Access.COMPLETE)) == 16
    assert bus.read_object_description(slave, 0x6040)[0] == "Controlword"
    assert "RxPDO" in bus.read_entry_description(slave, 0x6040, 0)[1]
    axes_of.append(read(slave, 0x1C12, 0)[0])
bus.create_mapping()
bus.request_state(kickcat.State.SAFE_OP)
bus.wait_for_state(kickcat.State.SAFE_OP, WAIT)
for slave in slaves:
    slave.set_output_bytes(bytes(slave.output_size))
bus.process_data()
bus.request_state(kickcat.State.OPERATIONAL)
bus.wait_for_state(kickcat.State.OPERATIONAL, WAIT, bus.process_data_no_check)

walk = Walk(axes_of)
cycles, wrong, late = 0, 0, 0
end = time.perf_counter() + float(sys.argv[2])
while time.perf_counter() < end:
    for position, slave in enumerate(slaves):
        slave.set_output_bytes(walk.outputs(position, slave.input_data))
    try:
        bus.process_data()
    except RuntimeError as error:
        # no frame in time, which a busy machine does
        is_late = "LOST" in str(error)
        late += is_late
        wrong += not is_late
    cycles += 1
    time.sleep(0.0005)
version = importlib.metadata.version("kickcat")
print(f"KickCAT {version}: {len(slaves)} slaves, {cycles} cycles, {wrong} with a wrong working counter, {late} later than 20 ms")
assert wrong == 0
assert cycles > 100 and late < cycles / 100
walk.check(cycles)
