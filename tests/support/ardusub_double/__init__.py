"""A double of ArduSub for tests and the bench: what a driver can tell of it, from facts that were
measured on ArduSub 4.5.0-beta1 and 4.8.0-dev on their own simulator board. The vehicle below the
motors is Lindy's simulator. No code of ArduSub is in it."""
