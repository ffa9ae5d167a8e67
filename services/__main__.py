"""Entry point of a service process: `python -m services '<Launch as JSON>'`, or `… hub ENDPOINT`.

People use `lindy run`; the supervisor uses this, because it starts in a tenth of a second.
"""

import sys

import msgspec

from services.runtime.process_host import Launch, run_hub, run_service


def main(arguments: list[str]) -> int:
    if arguments[0] == "hub":
        return run_hub(arguments[1], int(arguments[2]) if len(arguments) > 2 else None)
    return run_service(msgspec.json.decode(arguments[0], type=Launch))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
