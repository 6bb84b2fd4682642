"""The maker's Python package on a virtual moteus: whatever it does not find or understand is a fault of the emulator.

Called with the port of a bus with the joints of the PA-10, ids 1 to 7. Ends with an assertion's text at the first fault."""

import asyncio
import io
import json
import math
import subprocess
import sys
import tempfile

import moteus
from moteus import Mode, Register
from moteus import multiplex as mp


async def finds_and_reads(port, transport):
    found = await transport.discover()
    assert [device.can_id for device in found] == [1, 2, 3, 4, 5, 6, 7], found
    assert len({device.uuid for device in found}) == 7, found
    # by its identity instead of its number; `query` of the package's version 1.1.1 would leave the identity out
    third = moteus.Controller(moteus.DeviceAddress(uuid=found[2].uuid), transport=transport)
    reply = await third.set_stop(query=True)
    assert reply.id == 3, reply

    controller = moteus.Controller(4, transport=transport)
    for resolution in [mp.INT8, mp.INT16, mp.INT32, mp.F32]:
        query = moteus.QueryResolution()
        for name in ["mode", "position", "velocity", "torque", "q_current", "d_current", "power", "home_state",
                     "trajectory_complete", "voltage", "temperature", "fault"]:
            setattr(query, name, resolution)
        reply = await moteus.Controller(4, query_resolution=query, transport=transport).query()
        values = reply.values
        assert values[Register.MODE] == Mode.STOPPED, values
        assert abs(values[Register.VOLTAGE] - 24) < 0.3, values
        assert values[Register.FAULT] == 0 and values[Register.HOME_STATE] == 2, values
        assert len(values) == 12, values
    version = await controller.custom_query({Register.REGISTER_MAP_VERSION: mp.INT32})
    assert version.values[Register.REGISTER_MAP_VERSION] == 5, version


async def configures(transport):
    controller = moteus.Controller(2, transport=transport)
    stream = moteus.Stream(controller)
    assert await stream.command(b"conf get servo.default_timeout_s", allow_any_response=True) == b"0.100000"
    await stream.command(b"conf set servo.default_timeout_s 0.2")
    assert await stream.command(b"conf get servo.default_timeout_s", allow_any_response=True) == b"0.200000"
    await stream.command(b"conf set servo.default_timeout_s 0.1")
    try:
        await stream.command(b"conf set servo.no_such_thing 1")
        raise AssertionError("an entry that is not there was set")
    except moteus.CommandError as error:
        assert "error setting" in str(error), error
    stats = await stream.read_data("servo_stats")
    assert stats.mode.name == "stopped" and abs(stats.bus_V - 24) < 1e-3, stats
    position = await stream.read_data("motor_position")
    assert position.homed.name == "output" and len(position.sources) == 3, position
    # what comes without being asked for, in text
    await stream.command(b"tel fmt firmware 1")
    await stream.write_message(b"tel get firmware")
    assert (await stream.readline()).startswith(b"firmware.version "), "no text"
    await stream.command(b"d stop")
    await stream.command(b"d rezero 0.25")


async def moves(transport):
    controller = moteus.Controller(1, transport=transport)
    await controller.set_stop()
    start = (await controller.query()).values[Register.POSITION]
    target = start + 0.05
    # the integral does what the gain alone leaves to friction
    stream = moteus.Stream(controller)
    await stream.command(b"conf set servo.pid_position.ki 5000")
    await stream.command(b"conf set servo.pid_position.ilimit 80")
    await moteus.move_to(controller, position=target, velocity_limit=0.1, accel_limit=1.0, timeout=20.0)
    for _ in range(75):
        reply = await controller.set_position(position=target, query=True)
        await asyncio.sleep(0.02)
    assert reply.values[Register.MODE] == Mode.POSITION, reply
    # the gear sticks, so the integral goes past by a little
    assert abs(reply.values[Register.POSITION] - target) < 0.015, reply
    # the torque alone: no gain, a feedforward, and its limit
    query = moteus.QueryResolution()
    query._extra = {Register.CONTROL_TORQUE: mp.F32}
    limited = moteus.Controller(1, query_resolution=query, transport=transport)
    for _ in range(5):
        reply = await limited.set_position(position=math.nan, kp_scale=0.0, kd_scale=0.0, feedforward_torque=5.0,
                                           maximum_torque=2.0, query=True)
    assert abs(reply.values[Register.CONTROL_TORQUE] - 2.0) < 0.02, reply
    assert reply.values[Register.FAULT] == 102, reply
    # and nobody speaks for longer than the watchdog waits
    await asyncio.sleep(0.3)
    reply = await controller.query()
    assert reply.values[Register.MODE] == Mode.TIMEOUT, reply
    reply = await controller.set_position(position=math.nan, query=True)
    assert reply.values[Register.MODE] == Mode.TIMEOUT, "a timeout lasts until a stop"
    await controller.set_stop()
    reply = await controller.query()
    assert reply.values[Register.MODE] == Mode.STOPPED, reply
    # its own idea of where it is
    await controller.set_output_exact(position=1.5)
    reply = await controller.query()
    assert abs(reply.values[Register.POSITION] - 1.5) < 1e-3, reply
    await controller.set_output_nearest(position=target)
    reply = await controller.query()
    assert abs(reply.values[Register.POSITION] - target) < 0.02, reply
    await controller.set_brake()
    # a question may come before the drive's next step
    for _ in range(100):
        mode = (await controller.query()).values[Register.MODE]
        if mode in (Mode.BRAKE, 2, 3):
            break
        await asyncio.sleep(0.01)
    assert mode in (Mode.BRAKE, 2, 3), f"no brake but {mode}"
    await controller.set_stop()


def tool(port, *arguments):
    command = [sys.executable, "-m", "moteus.moteus_tool", "--fdcanusb", port, *arguments]
    done = subprocess.run(command, capture_output=True, text=True, timeout=30)
    assert done.returncode == 0, (arguments, done.stdout, done.stderr)
    return done.stdout


def serves_the_tool(port):
    info = json.loads(tool(port, "--target", "5", "--info"))
    assert len(info["serial_number"]) == 16 and len(info["uuid"]) == 36, info
    dumped = tool(port, "--target", "5", "--dump-config")
    lines = dict(line.split(" ") for line in dumped.splitlines() if " " in line)
    assert lines["id.id"] == "5" and lines["servo.default_timeout_s"] == "0.100000", dumped
    assert abs(float(lines["motor_position.rotor_to_output_ratio"]) - 0.02) < 1e-6, dumped
    stats = json.loads(tool(port, "--target", "5", "--read", "servo_stats"))
    assert stats["mode"] == 0, stats
    tool(port, "--target", "5", "--stop")
    with tempfile.NamedTemporaryFile("w", suffix=".cfg") as config:
        config.write("servo.max_velocity 3.0\n# a remark\n")
        config.flush()
        assert "could not" not in tool(port, "--target", "5", "--restore-config", config.name)
    assert "servo.max_velocity 3.000000" in tool(port, "--target", "5", "--dump-config")
    tool(port, "--target", "5", "--zero-offset")
    position = json.loads(tool(port, "--target", "5", "--read", "motor_position"))
    assert abs(position["position"]) < 1e-3, position


async def main(port):
    transport = moteus.transport.Transport([moteus.fdcanusb_device.FdcanusbDevice(port)])
    try:
        await finds_and_reads(port, transport)
        await configures(transport)
        await moves(transport)
    finally:
        transport.close()


if __name__ == "__main__":
    # an answer that never comes is a fault too
    asyncio.run(asyncio.wait_for(main(sys.argv[1]), timeout=120))
    serves_the_tool(sys.argv[1])
    print("the maker's package has found nothing wrong")
