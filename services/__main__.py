"""Entry point of a process: `python -m services LAUNCH`, or `… hub HUBLAUNCH`, both as JSON.

People use `lindy run`; the supervisor uses this, because it starts in a tenth of a second.
"""

import gc
import sys

from services.runtime.os import RARE_SEARCHES


def main(arguments: list[str]) -> int:
    gc.set_threshold(*RARE_SEARCHES)  # before the imports
    import msgspec

    from services.runtime.hosts.process_host import HubLaunch, Launch, run_hub, run_services

    if arguments[0] == "hub":
        return run_hub(msgspec.json.decode(arguments[1], type=HubLaunch))
    return run_services(msgspec.json.decode(arguments[0], type=Launch))


if __name__ == "__main__":
    status = main(sys.argv[1:])
    gc.freeze()  # nothing is searched at the end
    sys.exit(status)
