"""Names of this package and where they live; `lazy_loader` loads each when it is first used."""

from .arm_driver import ArmDriver as ArmDriver
from .execution import execute_grasp as execute_grasp
from .execution_config import ExecutionConfig as ExecutionConfig
from .ik import DifferentialIK as DifferentialIK
from .ik import solve_pose as solve_pose
from .reflex import Reflex as Reflex
from .reflex import ReflexConfig as ReflexConfig
from .verdict import ExecutionResult as ExecutionResult
