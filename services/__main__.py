"""Entry point of a process: `python -m services LAUNCH`, or `… hub HUBLAUNCH`, both as JSON.

People use `lindy run`; the supervisor uses this, because it starts in a tenth of a second.
"""

import sys

import msgspec

from services.runtime.hosts.process_host import HubLaunch, Launch, run_hub, run_services


def main(arguments: list[str]) -> int:
    if arguments[0] == "hub":
        return run_hub(msgspec.json.decode(arguments[1], type=HubLaunch))
    return run_services(msgspec.json.decode(arguments[0], type=Launch))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
