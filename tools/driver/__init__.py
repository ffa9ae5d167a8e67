"""`lindy check-driver`: does a vehicle side keep the promises of every vehicle side?"""
