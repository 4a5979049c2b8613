"""All rows and their Jacobian are the bits of CasADi's functions of the whole problem."""

import numpy as np

from aloft.planner.solving.constraint_values import ConstraintValues
from aloft.planner.solving.solve import make_problem
from aloft.planner.task.task import Knots, make_task
from aloft.robots.description import find_robot


def test_rows_and_entries_are_casadis():
    robot = find_robot("bruce")
    task = make_task({"name": "near", "robot": "bruce", "rise": 0.1, "distance_x": 0.05})
    task = task.resolved(robot).model_copy(
        update={"knots": Knots(squat=4, thrust=5, flight=4, landing=4)}
    )
    problem = make_problem(task, robot)
    own, theirs = ConstraintValues(problem.assembly), problem.assembly.jacobian()
    rng = np.random.default_rng(3)
    for _ in range(2):
        variables = rng.uniform(0.1, 0.5, problem.assembly.variables)
        own.set_parameters(problem.parameters)
        own.evaluate(variables)
        own.differentiate()
        rows, jacobian = theirs(variables, problem.parameters)
        np.testing.assert_array_equal(own.values, np.array(rows).ravel())
        np.testing.assert_array_equal(own.entries, np.array(jacobian.nonzeros()))
        assert jacobian.colind() == own.starts.tolist()
        assert jacobian.row() == own.rows.tolist()
