"""The reference model of Fernandes et al. 2015, with its misprints mended."""
