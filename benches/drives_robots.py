"""Robot files for benches/drives.sh: drives_robots.py ROBOTS FOLDER."""

import pathlib
import re
import sys

robots, folder = map(pathlib.Path, sys.argv[1:])


def with_drives(text, bus, joint):
    """The file with a [drive] table and one for each joint."""
    head, *joints = re.split(r"(?m)^\[\[joint\]\]\n", text)
    tables = [f"[[joint]]\n{joint(index)}\n{rest}" for index, rest in enumerate(joints)]
    first = re.search(r"(?m)^\[", head).start()
    return head[:first] + f"[drive]\n{bus}\n\n" + head[first:] + "".join(tables)


def on_ethercat(index):
    return "drive = { homed = true }"


pa10 = (robots / "pa10.toml").read_text()
(folder / "pa10-ethercat.toml").write_text(with_drives(pa10, 'interface = "veth0"', on_ethercat))
ports = ", ".join(f'"{folder}/port{bus}"' for bus in ["", 2, 3, 4])
(folder / "pa10-moteus.toml").write_text(
    with_drives(pa10, f"ports = [{ports}]", lambda index: f"drive = {{ id = {index + 1}, bus = {index * 4 // 7 + 1} }}")
)

# Twelve joints of the SHD-17 kind, light links, no gravity: what counts here is the bus.
one = (robots / "shd17.toml").read_text()
joint = re.sub(r"(?m)^name = .*\n", "", one[one.index("[[joint]]") + len("[[joint]]\n") :])
names = [f"joint{number}" for number in range(1, 13)]
links = [
    f"""[[link]]
joint = "{name}"
origin_m = [0.0, 0.0, 0.1]
axis = [{"0.0, 1.0, 0.0" if index % 2 else "0.0, 0.0, 1.0"}]
mass_kg = 0.05
centre_of_mass_m = [0.0, 0.0, 0.05]
inertia_kg_m2 = {{ xx = 1e-4, yy = 1e-4, zz = 1e-4 }}
"""
    for index, name in enumerate(names)
]
joints = [f'[[joint]]\nname = "{name}"\n{on_ethercat(0)}\n{joint}' for name in names]
head = f"""name = "twelve"
gravity_m_s2 = [0.0, 0.0, 0.0]

[control]
rate_hz = 1500.0
kind = "pd_feedforward"
proportional_nm_rad = {[400.0] * 12}
derivative_nm_s_rad = {[20.0] * 12}
feedback = "motor"
feedforward = "model"
velocity_filter_hz = 200.0
velocity_filter_order = 1
delay_cycles = 1

[drive]
interface = "veth0"

"""
(folder / "twelve-ethercat.toml").write_text(head + "\n".join(links + joints))
