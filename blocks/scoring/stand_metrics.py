"""The metrics that the scores of a jump and of a stance share."""

from __future__ import annotations

from math import degrees

from ...runtime.language.block import Metric
from .stand_criteria import StandRecord


def judgement_metrics(record: StandRecord, failure: str | None) -> dict[str, Metric]:
    """Success, its reason, and what the controller and the motors did in the whole run.

    Args:
        record: of a run of at least one tick.
        failure: the first criterion that does not hold, in words, or ``None``.
    """
    return {
        "success": failure is None,
        "reason": failure or "all criteria hold",
        "qp_failures": int(record.failures),
        "saturated_share": float(record.saturated / record.ticks),
        "peak_motor_torque_nm": float(record.peak_torque),
        "peak_motor_speed_rad_s": float(record.peak_speed),
        "forbidden_contacts": int(record.forbidden),
        "joint_limit_violation_rad": float(record.violation),
        "motor_overload_nm": float(record.overload),
    }


def rest_metrics(record: StandRecord) -> dict[str, Metric]:
    """How the robot stood when its rest was judged."""
    return {
        "final_tilt_deg": degrees(record.tilt),
        "final_com_speed_m_s": float(record.com_speed),
        "final_angular_speed_rad_s": float(record.angular_speed),
        "final_support_margin_m": float(record.margin),
        "final_load_share": float(record.load_share),
    }
