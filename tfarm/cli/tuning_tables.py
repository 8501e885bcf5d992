"""What `tfarm tune` and `tfarm study` print for a person."""

from __future__ import annotations

from typing import Any

from tfarm.cli.app import tell
from tfarm.cli.tables import new_table, show


def print_tuning(answer: dict[str, Any]) -> None:
    """The tuner beside its yardsticks."""
    table = new_table(("", "cost of a slew"))
    table.add_row("no moment feedback", f"{answer['cost_without']:.4g}")
    constant = f"best constant gain, K = {answer['best_constant_gain']:.4g}"
    table.add_row(constant, f"{answer['cost_best_constant']:.4g}")
    table.add_row(f"tuner, after {answer['trials']} trials", f"{answer['cost_tuned']:.4g}")
    for kind, values in answer["shaped"].items():
        late = f"{1e3 * values['arrives_later_by_s']:.0f} ms later"
        table.add_row(f"input shaping, {kind}, {late}", f"{values['cost']:.4g}")
    table.add_row("linear-quadratic bound of the unshaped slew", f"{answer['cost_lq_bound']:.4g}")
    show(table)
    print(f"guard {answer['guard_says']}")
    K = answer["gain"]["K"]
    print(f"gain: K from {min(K):.4g} to {max(K):.4g}")
    residual, without = answer["residual_moment_rms"], answer["residual_without"]
    print(f"residual root moment: {residual:.4g} N m rms, {residual / without:.3g} of that without moment feedback")
    if "comparison" in answer:
        _print_comparison(answer["comparison"])


def warn_if_stopped(answer: dict[str, Any]) -> None:
    """A line on standard error where learning diverged."""
    if answer["stopped"] is not None:
        tell(f"{answer['stopped']}; the tuner is that of the trial before")


def _print_comparison(rows: list[dict[str, Any]]) -> None:
    names = ("without", "best_constant", "own_constant", "ZV", "EI", "tuner", "bound")
    heads = ("no moment feedback", "constant", "own constant", "ZV", "EI", "tuner", "LQ bound")
    table = new_table(("condition", *heads, "guard proven"))
    for row in rows:
        costs = (f"{row[name]['cost']:.4g}" for name in names)
        table.add_row(row["condition"], *costs, "yes" if row["proven"] else "no")
    show(table)


def print_study(answer: dict[str, Any]) -> None:
    """A row a group of seeds, and the verdict of the map."""
    names = ("alpha", "eta", "a", "b", "inputs", "rule", "mode", "sensitivity")
    shown = [name for name in names if len({str(group[name]) for group in answer["groups"]}) > 1]
    costs = ("median", "lower quartile", "upper quartile", "best", "worst")
    table = new_table((*shown, *costs, "below best constant", "residual [N m]", "diverged", "died"))
    for group in answer["groups"]:
        low, high = group["cost_quartiles"]
        numbers = (group["cost_median"], low, high, group["cost_best"], group["cost_worst"])
        below = f"{group['below_best_constant']} of {answer['seeds']}"
        ends = (below, f"{group['residual_median']:.4g}", str(group["diverged"]), str(group["died"]))
        table.add_row(*(str(group[name]) for name in shown), *(f"{x:.4g}" for x in numbers), *ends)
    show(table)
    if "verdict" in answer:
        print(answer["verdict"])
