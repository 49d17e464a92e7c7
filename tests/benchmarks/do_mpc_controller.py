"""The controller's problem as somebody would state it in do-mpc (PyPI), to measure against."""

from collections.abc import Callable, Sequence

import casadi as ca
import do_mpc
import numpy as np

import szlib
from szlib.control.obstacles import Zone, barrier, cbf_residual, ellipse_formula
from szlib.core.checks import Array


def do_mpc_step(
    settings: szlib.MPCSettings, zone: szlib.Ellipse
) -> Callable[..., Array]:
    """A function (state, target, person) -> control for one person and no wall, warm from call to call."""
    s = settings
    model = do_mpc.model.Model("discrete")
    x, u = model.set_variable("_x", "x", (4, 1)), model.set_variable("_u", "u", (2, 1))
    varying = {"target": 2, "here": 5, "after": 5, "active": 1}
    for name, size in varying.items():
        model.set_variable("_tvp", name, (size, 1))
    model.set_rhs("x", _following(x, u, s.dt))
    model.setup()
    x, u = model.x["x"], model.u["u"]  # set-up makes new symbols
    following = _following(x, u, s.dt)
    target, here, after, active = (model.tvp[name] for name in varying)

    mpc = do_mpc.controller.MPC(model)
    mpc.settings.n_horizon, mpc.settings.t_step = s.N, s.dt
    mpc.settings.state_discretization, mpc.settings.store_full_solution = (
        "discrete",
        False,
    )
    mpc.settings.supress_ipopt_output()
    error = x - ca.vertcat(target, 0, 0)
    weighted = [ca.dot(ca.DM(weights), error**2) for weights in (s.P, s.Q)]
    mpc.set_objective(mterm=weighted[0], lterm=weighted[1] + ca.dot(ca.DM(s.R), u**2))
    mpc.set_rterm(u=0)
    mpc.bounds["lower", "_u", "u"], mpc.bounds["upper", "_u", "u"] = -s.a_max, s.a_max

    def h(point: ca.SX, person: ca.SX) -> ca.SX:
        distance = ellipse_formula(point[0], point[1], *ca.vertsplit(person))
        return barrier(distance, s.r_robot, s.eps)

    residual = cbf_residual(h(following, after), h(x, here), s.gamma)
    mpc.set_nl_cons("cbf", -active * residual, ub=0)
    mpc.set_nl_cons("speed", ca.sumsqr(following[2:]) - s.v_max**2, ub=0)

    template = mpc.get_tvp_template()
    known = {"target": np.zeros(2), "person": szlib.Person((0, 0), heading=0.0)}

    def predictions(_: float) -> object:
        for k in range(s.N + 1):
            template["_tvp", k, "target"] = known["target"]
            later = [known["person"].after(j * s.dt) for j in (k, k + 1)]
            seen = [
                Zone.place(zone, p.position, p.heading or 0.0, p.velocity)[:5]
                for p in later
            ]
            template["_tvp", k, "here"], template["_tvp", k, "after"] = (
                np.array(each) for each in seen
            )
            template["_tvp", k, "active"] = float(k < s.N_h)
        return template

    mpc.set_tvp_fun(predictions)
    mpc.setup()

    def step(state: Array, target: Sequence[float], person: szlib.Person) -> Array:
        known.update(target=np.asarray(target), person=person)
        if mpc.t0 == 0:
            mpc.x0 = state
            mpc.set_initial_guess()
        return np.asarray(mpc.make_step(state.reshape(-1, 1))).ravel()

    return step


def _following(x: ca.SX, u: ca.SX, dt: float) -> ca.SX:
    return ca.vertcat(x[:2] + dt * x[2:] + dt**2 / 2 * u, x[2:] + dt * u)
