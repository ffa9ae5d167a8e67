"""Is a vulnerability known of any locked package? `python -m tests.wheel.audit` asks osv.dev."""

import subprocess
import sys

KNOWN, NOT_ASKED = 1, 2  # exit statuses of uv


def main() -> int:
    """1: one is known, and was printed; else 0, also where nobody could be asked."""
    command = [sys.executable, "-m", "uv", "audit", "--quiet", "--frozen"]
    command += ["--preview-features", "audit-command"]
    done = subprocess.run(command, stderr=subprocess.DEVNULL, check=False)
    if done.returncode == NOT_ASKED:
        print("not audited: uv could not ask osv.dev for known vulnerabilities")
    return int(done.returncode == KNOWN)


if __name__ == "__main__":
    sys.exit(main())
