"""What a mission can ask of its flight: the numbers that judge one, by name, and the bounds on them.

Their formulas stand in :mod:`colift.record.metrics`.
"""

from __future__ import annotations

from typing import NamedTuple


class Metric(NamedTuple):
    """One number: its name (which ends in its unit) and meaning."""

    name: str
    unit: str
    meaning: str


METRICS = (
    Metric("tracking_rms_m", "m", "root mean square of the load's distance from its reference"),
    Metric("tracking_max_m", "m", "largest distance of the load from its reference"),
    Metric("attitude_rms_deg", "deg", "root mean square of the angle of a rigid load from its wanted attitude"),
    Metric("attitude_max_deg", "deg", "largest angle of a rigid load from its wanted attitude"),
    Metric("yaw_max_deg", "deg", "largest part of that angle about the vertical"),
    Metric("min_angle_deg", "deg", "smallest angle between two actual cables at any time"),
    Metric("usual_angle_deg", "deg", "median over time of the smallest angle between two actual cables"),
    Metric("min_desired_angle_deg", "deg", "smallest angle between two wanted cables at any time"),
    Metric("min_drone_distance_m", "m", "smallest distance between the centres of two drones at any time"),
    Metric("min_downwash_distance_m", "m", "the same with heights as parts of the allocator's downwash: room above each other counts less"),
    Metric("min_cable_distance_m", "m", "smallest distance from the centre of a drone to another's cable, taken as straight, at any time"),
    Metric("min_load_distance_m", "m", "smallest distance from the centre of a drone to the box around a rigid load at any time"),
    Metric("min_clearance_m", "m", "smallest room between an obstacle and a drone, taken as a ball, its cable, taken as straight, or the load, at any time"),
    Metric("max_tilt_deg", "deg", "largest tilt of a drone that nothing has broken, its thrust axis from the vertical"),
    Metric("peak_thrust_fraction", "1", "largest thrust of a drone as a share of the most that it can give"),
    Metric("peak_total_tension_N", "N", "largest simultaneous sum of tensions, between recorded rows too"),
    Metric("mean_total_tension_N", "N", "time average of the sum of tensions"),
    Metric("peak_tension_N", "N", "largest tension of any cable, between recorded rows too; without a plastic jerk's impulse"),
    Metric("max_catch_impulse_Ns", "N s", "largest catch: what stops a drone and the load that part with a slack cable's last slack"),
    Metric("tension_integral_10s_Ns", "N s", "sum of tensions integrated over the first 10 s (the paper's J_T)"),
    Metric("tension_integral_Ns", "N s", "sum of tensions integrated over the flight"),
    Metric("tension_tracking_rms_N", "N", "root mean square of actual less wanted tension, over all cables"),
    Metric("tension_imbalance", "1", "largest over smallest mean tension of the cables"),
    Metric("energy_imbalance", "1", "largest over mean power of the drones in flight, power taken as thrust^(3/2)"),
    Metric("slack_time_s", "s", "time without tension while the load is off the ground, summed over cables"),
    Metric("saturated_time_s", "s", "time in which motors could not give what was commanded, summed over drones"),
    Metric("min_height_m", "m", "least height of the load"),
    Metric("touch_speed_mps", "m/s", "largest downward speed with which the load came onto the ground; 0 if it never did"),
    Metric("ground_time_s", "s", "time that the load was on the ground"),
    Metric("drone_touch_speed_mps", "m/s", "largest downward speed with which a drone came onto the ground; 0 if none did"),
    Metric("lift_peak", "1", "largest tension of a cable at take-off, from when they come taut, over the load's weight"),
    Metric("touch_peak", "1", "largest tension of a cable at touch-down over the load's weight"),
    Metric("lifted_m", "m", "largest height of the load above where it lay, of a load that is to be lifted"),
    Metric("dragged_m", "m", "how far the load was dragged over the ground before it was lifted"),
    Metric("touch_height_m", "m", "height of the load above the ground when its touch-down was told"),
    Metric("placement_m", "m", "distance in the level between where the load was set down and where it should be"),
    Metric("weighed_mass_kg", "kg", "mass of the load as weighed at lift-off"),
    Metric("setbacks", "1", "how often a load was not lifted: hooked anew, or given up"),
    Metric("lost_drones", "1", "drones that left before the end"),
    Metric("detection_delay_s", "s", "longest time from a cut cable or dead motors to the drone's leaving the team"),
    Metric("allocator_failures", "1", "allocations that failed: not the best answer, and no limit to blame"),
    Metric("allocator_silent", "1", "cycles in which the allocator did not answer"),
    Metric("allocator_limited", "1", "allocations whose force had to give way to a limit, or that were regaining the limits"),
    Metric("max_missing_moment_Nm", "N m", "most that an allocation left out of the wanted moment on a rigid load; none for a point"),
    Metric("allocator_mean_iterations", "1", "mean iterations of an allocation"),
    Metric("allocator_max_iterations", "1", "most iterations of an allocation"),
    Metric("allocator_mean_us", "us", "mean duration of an allocation"),
    Metric("allocator_median_us", "us", "median duration of an allocation"),
    Metric("allocator_p99_us", "us", "99th percentile of the duration of an allocation"),
    Metric("allocator_max_us", "us", "longest allocation"),
)  # fmt: skip
"""Every metric, in the order of the report."""
