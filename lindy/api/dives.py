"""Any set of services on virtual time, stepped by you: the same seed gives the same dive."""

from services.runtime.config.stack import Stack
from services.runtime.hosts.registry import Registry
from services.runtime.hosts.virtual_host import Skew, VirtualHost

__all__ = ["Registry", "Skew", "Stack", "VirtualHost"]
