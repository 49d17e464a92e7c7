"""A robot with two wheels in a physics engine, among recorded people: `pip install mujoco`, then

    python mujoco_drive.py TRACKS [MAP.yaml]

It goes to and fro across the middle of TRACKS for a minute, at 20 Hz, and knows its position with noise and one step
late. MuJoCo has wheels, motors, friction and contacts. People do not react. A contact may follow only a step that
said it was not safe.
"""

import sys

import mujoco
import numpy as np

import szlib

DT, RADIUS, WHEEL, HALF_AXLE, BODY = 0.05, 0.3, 0.1, 0.2, 0.25  # [s], then [m]; BODY is that of a person
NOISE = (0.01, 0.01, 0.005)  # standard deviations of the robot's x, y [m] and heading [rad]
PLACES = 8  # bodies for the nearest people
MODEL = """<mujoco><option timestep="0.002" integrator="implicitfast"/><worldbody>
<geom type="plane" size="60 60 1"/><body name="robot" pos="{x} {y} {WHEEL}"><freejoint/>
 <geom name="disc" type="cylinder" size="{RADIUS} 0.05" pos="0 0 0.08" mass="15"/>
 <geom type="sphere" size="0.05" pos="0.22 0 -0.05" mass="1" condim="1" priority="1"/>
 <geom type="sphere" size="0.05" pos="-0.22 0 -0.05" mass="1" condim="1" priority="1"/>
 <body pos="0 {HALF_AXLE} 0"><joint name="left" axis="0 1 0"/>{wheel}</body>
 <body pos="0 -{HALF_AXLE} 0"><joint name="right" axis="0 1 0"/>{wheel}</body></body>{people}{walls}</worldbody>
<actuator><velocity joint="left" kv="20"/><velocity joint="right" kv="20"/></actuator></mujoco>"""


def build(start: np.ndarray, walls: np.ndarray) -> mujoco.MjModel:
    """The robot at `start`, bodies for people, and a box along each of the `walls`."""
    wheel = f'<geom type="cylinder" size="{WHEEL} 0.02" euler="90 0 0" mass="1" friction="1.5 0.01 0.001"/>'
    person = f'<body mocap="true"><geom type="cylinder" size="{BODY} 0.8"/></body>'
    box, boxes = '<geom type="box" size="{} 0.005 0.5" pos="{} {} 0.5" euler="0 0 {}"/>', ""
    for (x, y), (dx, dy) in zip(walls.mean(axis=1), walls[:, 1] - walls[:, 0], strict=True):
        boxes += box.format(np.hypot(dx, dy) / 2, x, y, np.degrees(np.arctan2(dy, dx)))
    parts = {"wheel": wheel, "people": PLACES * person, "walls": boxes, **globals()}
    return mujoco.MjModel.from_xml_string(MODEL.format(x=start[0], y=start[1], **parts))


def run(tracks: str, walls: np.ndarray | None = None, seconds: float = 60.0, seed: int = 0) -> dict[str, int]:
    """Drive for some time; count the goals that were reached, steps, and steps with a contact."""
    rng, walls = np.random.default_rng(seed), np.zeros((0, 2, 2)) if walls is None else walls
    table = szlib.read_tracks(tracks)
    paths = {i: one.to_numpy(float) for i, one in table.groupby("id")[["t", "x", "y", "vx", "vy"]]}
    goals = table[["x", "y"]].median().to_numpy() + np.array([(-4.0, 0.0), (4.0, 0.0)])
    model = build(goals[0], walls)
    data, disc = mujoco.MjData(model), model.geom("disc").id
    settings = szlib.MPCSettings.among_people(dt=DT, r_robot=RADIUS, v_max=0.8).with_gamma_rate(0.8)
    zone = szlib.reference_zone("grand-central-strangers").ellipse
    drive = szlib.DifferentialDrive(zone, walls=walls, settings=settings)
    known, count = (
        np.array([*goals[0], 0.0]),
        {"goals": 0, "steps": 0, "safe": 0, "contacts": 0, "unannounced": 0},
    )
    for now in np.arange(0.0, seconds, DT):
        t = table["t"].min() + now
        here = {i: path for i, path in paths.items() if path[0, 0] <= t <= path[-1, 0]}
        seen = [(i, [np.interp(t, path[:, 0], each) for each in path.T[1:]]) for i, path in here.items()]
        seen = sorted(seen, key=lambda one: np.hypot(*(one[1][:2] - data.qpos[:2])))[:PLACES]
        data.mocap_pos[:] = (0.0, 0.0, -9.0)
        people = [szlib.Person((x, y), (vx, vy), id=i) for i, (x, y, vx, vy) in seen]
        goal = goals[(count["goals"] + 1) % 2]
        step = drive.step(known, goal, people, state_age=DT, now=float(now))
        known = np.append(data.qpos[:2], 2 * np.arctan2(data.qpos[6], data.qpos[3])) + rng.normal(0, NOISE)
        (v, omega), touched = step.control, False
        data.ctrl[:] = (v - omega * HALF_AXLE) / WHEEL, (v + omega * HALF_AXLE) / WHEEL
        for k in range(round(DT / model.opt.timestep)):
            for place, person in enumerate(people):
                data.mocap_pos[place] = (*person.after(k * model.opt.timestep).position, 0.8)
            mujoco.mj_step(model, data)
            touched |= any(disc in contact.geom for contact in data.contact)
        arrived = np.hypot(*(data.qpos[:2] - goal)) < 0.3
        found = (arrived, 1, step.safe, touched, touched and step.safe)
        count = {name: n + int(one) for (name, n), one in zip(count.items(), found, strict=True)}
    return count


if __name__ == "__main__":
    print(run(sys.argv[1], *map(szlib.walls_from_map, sys.argv[2:]))) if sys.argv[1:] else sys.exit(__doc__)
