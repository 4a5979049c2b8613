"""The tasks of the whole-body controller: small classes with an error, a Jacobian and gains each."""

from __future__ import annotations

from .task import FeedbackGains, FeedbackTask, Task, TaskError, TaskJacobian

__all__ = ["FeedbackGains", "FeedbackTask", "Task", "TaskError", "TaskJacobian"]
