"""Reference and state become a wrench; the wrench becomes thruster commands."""
