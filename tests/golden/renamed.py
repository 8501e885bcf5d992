"""JSON keys of version 1.0 by those that answers were kept under: the same numbers are compared.

A row is command, path that was, path that is (None: it went, see CHANGELOG.md); the first that matches counts.
"""

import re

LOOP, GAIN = r"(loops\[\d\]\.)?", r"(K1|K2|Kp)"
PLACES = (
    ("phase", "phase_margin"),
    ("phase_lag", "phase_lag"),
    ("phase_lead", "phase_lead"),
    ("delay", "delay_margin"),
    ("disk", "disk_margin"),
    ("peak_sensitivity", "peak_sensitivity"),
    ("peak_complementary", "peak_complementary_sensitivity"),
)
ENDS = (("0", "low"), ("1", "high"))
INTERVALS = (
    (rf"{GAIN}_interval%s", r"[\2].interval"),
    (rf"{GAIN}_windows%s\[(\d+)\]", r"[\2].intervals[\3]"),
    (r"windows\[(.+?)\].interval%s", r"[\2].interval"),
    (r"windows\[(.+?)\].windows%s\[(\d+)\]", r"[\2].intervals[\3]"),
)
RENAMED = (
    # stability intervals, of gains at the hub and of the numbers of a law
    *(("margins|compare", rf"{LOOP}{old % ends}\[{n}\]", rf"\1stability_intervals{new}.{end}{kind}")
      for old, new in INTERVALS for ends, kind in (("", ""), ("_ends", "_is")) for n, end in ENDS),
    ("margins|compare", rf"{LOOP}{GAIN}_looked_at(.*)", r"\1stability_intervals[\2].search_range\3"),
    ("margins|compare", rf"{LOOP}{GAIN}_band_rad_s", r"\1stability_intervals[\2].up_to_rad_s"),
    ("margins|compare", rf"{LOOP}windows\[(.+?)\].looked_at(.*)", r"\1stability_intervals[\2].search_range\3"),
    ("margins|compare", rf"{LOOP}windows\[(.+?)\].band_rad_s", r"\1stability_intervals[\2].up_to_rad_s"),
    ("margins|compare", rf"{LOOP}windows\[(.+?)\].(number|value)", r"\1stability_intervals[\2].\3"),
    ("margins|compare", rf"{LOOP}windows", r"\1stability_intervals"),
    ("sampled", rf"{GAIN}_interval(\[\d\])?", r"stability_intervals[\1].interval\2"),
    *(("sampled", rf"{GAIN}_intervals\[(\d+)\]\[{n}\]", rf"stability_intervals[\1].intervals[\2][{n}].value")
      for n, _ in ENDS),
    ("sampled", rf"shown\.{GAIN}_intervals\[(\d+)\]\[(\d)\]\.settled",
     r"stability_intervals[\1].intervals[\2][\3].certified"),
    ("sampled", rf"shown\.{GAIN}_intervals\[(\d+)\]\[(\d)\]\.band_rad_s",
     r"stability_intervals[\1].intervals[\2][\3].up_to_rad_s"),
    ("sampled", rf"shown\.{GAIN}_intervals\[(\d+)\]\[(\d)\]\.(\w+)", r"stability_intervals[\1].intervals[\2][\3].\4"),
    ("sampled", rf"(shown\.)?{GAIN}_intervals", r"stability_intervals[\2].intervals"),
    ("sampled|compare", rf"{LOOP}windows\[(.+?)\].windows(.*)", r"\1stability_intervals[\2].intervals\3"),
    ("sampled|compare", rf"{LOOP}windows\[(.+?)\].(.*)", r"\1stability_intervals[\2].\3"),
    ("sampled", "windows", "stability_intervals"),
    (".*", rf"{LOOP}windows_note", r"\1intervals_note"),
    # margins
    ("margins|compare", rf"{LOOP}in_band\.band_rad_s", r"\1in_range.up_to_rad_s"),
    *(("margins|compare", rf"{LOOP}(in_band\.)?at_rad_s\.{old}", rf"\1in_range.{new}_at_rad_s") for old, new in PLACES),
    ("margins|compare", rf"{LOOP}in_band(.*)", r"\1in_range\2"),
    ("margins|compare", rf"{LOOP}(at_rad_s|gain_margin|phase_crossovers|gain_crossovers)", None),  # of no stable loop
    ("margins|compare", rf"{LOOP}(phase_\w+_deg)", r"\1in_range.\2"),
    # verdicts
    ("sampled", r"shown\.delay_margin_samples\.settled", "delay_margin.certified"),
    ("sampled", r"shown\.delay_margin_samples\.band_rad_s", "delay_margin.up_to_rad_s"),
    ("sampled", r"shown\.required_damping_s\.settled", "minimum_damping_s.certified"),
    ("sampled", r"shown\.required_damping_s\.band_rad_s", "minimum_damping_s.up_to_rad_s"),
    ("sampled", r"shown\.delay_margin_samples\.(.*)", r"delay_margin.\1"),
    ("sampled", r"shown\.required_damping_s\.(.*)", r"minimum_damping_s.\1"),
    ("sampled", "required_damping_s", "minimum_damping_s.value"),
    ("sampled", "rule_in_words", "rule"),
    ("sampled", "settled", "certified"),
    ("sampled", "nearest", "dominant"),
    ("sampled", "(law|rule|free_hub_angle)", None),  # prose, where it was something else
    (".*", r"(.*\.)?beyond_the_band", r"\1beyond"),
    (".*", r"(.*\.)?known_beyond_the_band", r"\1known_beyond"),
    (".*", r"(.*\.)?band_rad_s", r"\1up_to_rad_s"),
    ("simulate", "rule", None),
    ("simulate", "rule_in_words", "rule"),
    ("fit", r"parameters\.([\w.:/@]+)\.(\w+)", r"parameters[\1].\2"),
    ("fit", r"frequencies_hz\.(before|after|measured)\[(\d+)\]", r"resonances[\2].\1_hz"),
    ("fit", r"frequencies_hz.*", "resonances"),
    ("response .*--measured.*", r"band_hz(.*)", r"range_hz\1"),
    ("response .*--measured.*", "measured", "source"),
    ("frf", "record", "source"),
    ("frf", "lines", "points"),
    ("response .*--measured.*", "(required_percent.*|notes?)", None),
    ("assumptions", r"(.*\.)?(shape|sensitivity_to)", None),
    ("tune", r"guard_(\w+)", r"guard.\1"),
    ("tune", r"guard\[\d\]", None),
    ("bode|reduce", r"band_rad_s(.*)", r"range_rad_s\1"),
    *(("bode", rf"((poles|zeros)\[\d+\])\.{part}", rf"\1.s[{n}]") for n, part in enumerate(("re", "im"))),
    ("reduce", r"errors\.(\w+)", r"channels[\1].error"),
    ("reduce", r"worst_at_rad_s\.(\w+)", r"channels[\1].worst_at_rad_s"),
    ("reduce", r"(first_mode_lacking_hz|input_unit|inputs|outputs|units)\b.*", None),
    ("poles|modes", "(proven_)?complete", None),
    ("modes .*--compare", "theory", None),
    ("modes .*--compare", r"index(\[\d\])", r"at\1"),
    ("response .*--compare", r"s(\[.*)", r"at\1"),
    ("modes", r"(modes\[\d+\])\.eigenvalues\[0\]", r"\1.eigenvalue[0]"),
    ("modes", r"(modes\[\d+\])\.eigenvalues\[1\]", r"\1.second_eigenvalue"),
    # designs
    ("design", r"coefficients\.(\w+)", r"coefficients[\1].value"),
    ("design", r"bounds\.(\w+)(.*)", r"coefficients[\1].bounds\2"),
    ("design", r"flat_(\w+?)(\[\d\])", r"coefficients[\1].within_one_per_cent\2"),
    ("design", r"(at_bound|at_limit|widened).*", None),
    ("design", r"arms\[(\d+)\]\.sampled\..*", r"arms[\1].sampled"),
    # loci and planes
    ("locus", r"gap_by_branch\[(\d+)\]", r"branch_list[\1].gap"),
    ("locus", r"mode\[(\d+)\]", r"branch_list[\1].mode"),
    ("locus", r"(branches_note|gap_note|ends|reduced_points)", None),
    ("map", r"K1(.*)", r"x\1"),
    ("map", r"K2(.*)", r"y\1"),
    *(("spill", rf"models\[(\d+)\]\.{part}", rf"models[\1].rightmost[{n}]") for n, part in enumerate(("re", "im"))),
    # comparisons
    ("compare", r"names\[(\d)\]", r"sides[\1].name"),
    ("compare", r"verdicts\[(\d)\]", r"sides[\1].verdict"),
    ("compare", r"sampled\[\d\]\..*", None),  # a line of text each
    ("compare .*--law .*--law.*", r"modes.*", None),  # the same arm twice
    ("compare", r"modes\[(\d+)\]\.natural_frequency_rad_s_(one|other)", r"modes[mode \1: natural frequency].\2"),
    ("compare", r"modes\[(\d+)\]\.damping_ratio_(one|other)", r"modes[mode \1: damping ratio].\2"),
    ("compare", r"poles\[0\]\.size_rad_s_(one|other)", r"poles[the hub: abs(s)].\1"),
    ("compare", r"poles\[0\]\.damping_ratio_(one|other)", r"poles[the hub: damping ratio].\1"),
    ("compare", r"poles\[(\d+)\]\.size_rad_s_(one|other)", r"poles[mode \1: abs(s)].\2"),
    ("compare", r"poles\[(\d+)\]\.damping_ratio_(one|other)", r"poles[mode \1: damping ratio].\2"),
    ("compare", r"(modes|poles|unpaired_poles|margins)\b.*", None),  # now quantity by quantity
)  # fmt: skip


def renamed(line, path):
    """The path that an entry of a kept answer has now, None where it went."""
    for of, pattern, new in RENAMED:
        if (re.fullmatch(of, line.split()[0]) or re.fullmatch(of, line)) and (found := re.fullmatch(pattern, path)):
            return None if new is None else found.expand(new)
    return path
