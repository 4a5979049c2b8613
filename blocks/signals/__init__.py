"""The signals that travel between blocks and the robot, which all blocks share.

Conventions, the same everywhere:

* SI units. World frame: z up. Body frame: the base link's, x forward, y left, z up.
* Orientation: unit quaternion x, y, z, w (Hamilton) that takes body vectors to the world.
* Generalised velocity (n_velocities): base linear velocity in the body frame, base angular
  velocity in the body frame, joint velocities (Pinocchio's order). A robot whose base is fixed has
  joint velocities only.
* Joints, feet and contact points are in the order of the robot's description. BRUCE: right leg first,
  per leg hip yaw, hip pitch, hip roll, knee, ankle; toe before heel.
* Six-vectors (momentum): linear part first.
"""

from __future__ import annotations

from ...planner.task.phase import Phase
from .control import (
    BaseState,
    ContactState,
    DelayEstimate,
    DynamicsTerms,
    EstimatorHealth,
    FootLoad,
    FootTarget,
    JointTarget,
    JointTorque,
    MassEstimate,
    MotorCondition,
    PointTarget,
    PoseMeasurement,
    SwitchFault,
    SwitchHealth,
    WholeBodyCommand,
    WholeBodyTarget,
)
from .jumping import JumpReference, PhaseState
from .robot import (
    CommandMode,
    ContactSwitches,
    DrivePhase,
    ExternalForce,
    ImuReading,
    JointCommand,
    JointState,
    RobotHealth,
    RobotTruth,
    ThrustCommand,
    ThrusterState,
)

__all__ = [
    "BaseState",
    "CommandMode",
    "ContactState",
    "ContactSwitches",
    "DelayEstimate",
    "DrivePhase",
    "DynamicsTerms",
    "EstimatorHealth",
    "ExternalForce",
    "FootLoad",
    "FootTarget",
    "ImuReading",
    "JointCommand",
    "JointState",
    "JointTarget",
    "JointTorque",
    "JumpReference",
    "MassEstimate",
    "MotorCondition",
    "Phase",
    "PhaseState",
    "PointTarget",
    "PoseMeasurement",
    "RobotHealth",
    "RobotTruth",
    "SwitchFault",
    "SwitchHealth",
    "ThrustCommand",
    "ThrusterState",
    "WholeBodyCommand",
    "WholeBodyTarget",
]
