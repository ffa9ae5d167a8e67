"""What programs outside of Lindy may use. Everything else may change or move without notice.

Each module is imported for itself, so that a driver loads no more than it needs:

- `messages`: the topics, and what is sent on them
- `service`: to write a service or a driver: its node, its stack, its settings
- `vehicle`: vehicle files, thrust allocation, rigid-body physics
- `references`: reference generators; they need no bus and no clock
- `laws`: to fly a reference law of your own
- `links`: the model of a tether and its profiles
- `recordings`: to read what a dive recorded
- `dives`: any set of services on virtual time
"""

from services.runtime.config.errors import LindyError
from services.runtime.config.settings import DEPLOY

__all__ = ["DEPLOY", "LindyError"]
