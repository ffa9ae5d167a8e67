"""The rerun recording on disk, and the live viewer."""
