"""What `tfarm tune` prints for a person."""

from __future__ import annotations

from typing import Any

from tfarm.arm import ANGLE_GAIN
from tfarm.cli.app import tell
from tfarm.columns import Column, Table
from tfarm.digits import general, singly
from tfarm.tables.terminal import show

FOUR = singly(general, 4)  # digits of a cost


def print_tuning(answer: dict[str, Any]) -> None:
    """The tuner beside its yardsticks."""
    costs = {
        "no moment feedback": answer["cost_without"],
        f"best constant gain, K = {answer['best_constant_gain']:.4g}": answer["cost_best_constant"],
        f"tuner, after {answer['trials']} trials": answer["cost_tuned"],
    }
    for kind, values in answer["shaped"].items():
        costs[f"input shaping, {kind}, {1e3 * values['arrives_later_by_s']:.0f} ms later"] = values["cost"]
    costs["linear-quadratic bound of the unshaped slew"] = answer["cost_lq_bound"]
    columns = Column("", of=list(costs)), Column("cost", "cost of a slew", of=list(costs.values()), digits=FOUR)
    show(Table(columns=columns))
    if (unit := answer["cost_unit_N_m"]) != 1.0:
        print(f"costs count moments and torques in units of {unit:g} N m")
    print(f"guard {answer['guard_says']}")
    K = answer["gain"]["K"]
    print(f"gain: K from {min(K):.4g} to {max(K):.4g}")
    print(f"residual root moment, less the rigid arm's: {_residual(answer)}")
    errors = [answer[f"tip_error{which}_m"] for which in ("", "_best_constant", "_without")]
    tuned, constant, free = ("ran away" if each is None else f"{1e3 * each:.3g} mm" for each in errors)
    name = ANGLE_GAIN
    held = f"{name} = {answer[name]:g} holds the angle" if answer[name] else f"nothing holds the angle: --{name} does"
    print(f"tip off its target at the end: {tuned}, {constant} with the best constant gain, {free} without ({held})")
    if "curves" in answer:
        _print_curves(answer["curves"], answer["cost_best_constant"])
    if "comparison" in answer:
        _print_comparison(answer["comparison"])


def _residual(answer: dict[str, Any]) -> str:
    """With the tuner, and as a share of that without moment feedback."""
    residual, without = answer["residual_moment_rms"], answer["residual_without"]
    if residual is None:
        return "not computed, as the loop ran away"
    share = f", {residual / without:.3g} of that without moment feedback" if without else ""
    return f"{residual:.6g} N m rms{share}"


def _print_curves(curves: dict[str, Any], best_constant: float) -> None:
    lower, median, upper = curves["final_quartiles"]
    counts = {
        "below the best constant gain": sum(cost < best_constant for cost in curves["final_cost"]),
        "diverged": curves["diverged"],
        "died at K = 0": curves["died"],
    }
    print(f"learning curves, {curves['seeds']} seeds: final cost {median:.4g}, quartiles {lower:.4g} and {upper:.4g}")
    print("seeds: " + ", ".join(f"{number} {what}" for what, number in counts.items()))


def warn_of_divergence(answer: dict[str, Any]) -> None:
    """A line on standard error where learning diverged."""
    if answer["stopped"] is not None:
        tell(f"{answer['stopped']}; the tuner is that of the trial before")


def _print_comparison(rows: list[dict[str, Any]]) -> None:
    names = ("without", "best_constant", "own_constant", "ZV", "EI", "tuner", "bound")
    heads = ("no moment feedback", "constant", "own constant", "ZV", "EI", "tuner", "LQ bound")
    columns = (
        Column("condition", "condition", of=[row["condition"] for row in rows]),
        *(
            Column(name, head, of=[row[name]["cost"] for row in rows], digits=FOUR)
            for name, head in zip(names, heads, strict=True)
        ),
        Column("proven", "guard proven", of=["yes" if row["proven"] else "no" for row in rows]),
    )
    show(Table(columns=columns))
