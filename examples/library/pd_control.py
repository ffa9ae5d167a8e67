"""A controller in the place of Lindy's: PD on depth and heading, sticks passed on as forces.

lindy simulate --stack examples/library/pd_stack.toml --set pd_control.depth_kp=80
"""

import msgspec

from messages import topics
from messages.control import ThrusterCommand, Wrench
from messages.reference import Reference
from messages.units import NotNegativeSetting
from services.control.allocation.allocation import Allocation
from services.marine.vehicle import Vehicle
from services.runtime.config.stack import Stack
from services.runtime.node.node import Node
