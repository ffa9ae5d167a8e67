"""The emulated link: the only connection between topside and drone. It forwards the topics of
direction DOWN, UP and BOTH."""
