"""The words of research/measurements/scale.md; `page` fills in its tables."""

PAGE_TEXT = """# How many drones a network carries

Written by `make docs`; do not edit. `python -m lindy_research.scale` prints it, and with
`--measure` measures its points anew.

What breaks first:

1. **The number of hubs in one network.** 80 hubs of drones and pilots settle within seconds; 120
   on two busy cores did not. More drones need networks that do not know each other's hubs: a
   router, or a few, for a class or a site, with drones and pilots of that part only.
2. **The uplink of a site.** Ten flown drones are more than most mobile networks carry upwards.
   Thinned (`downsampling` in deploy/router.json5) they need less than a third. Commands are never
   thinned.
3. **A core router.** 1,000 drones need several, and Zenoh does not balance the load between them.

A computer of two cores does not fly eight drones: commands came too late, and the drones stopped
and held. `lindy bench --only fleet` measures a computer with eight.

## What a drone sends

The rows of the topic table that the other side asks for, at their rates, without video.

{traffic}

## What a network carries

Ten drones at the router of their site, 25 pilots at a router of the centre, and core routers
between them, each of which takes half a core at most. Every drone is flown, and two people watch
all with `lindy drones --watch`. For 1,000 drones this is what links and routers would carry, not
that one network of so many hubs works.

{fleets}

With the links of all sites thinned:

{thinned}

Two straight lines give this: a router needs {idle} of a core while nobody speaks and {message} for
each message, and a link carries the payload and {overhead} bytes for each message. They are
fitted to every second of {points} points measured with synthetic drones on two routers
({where}), and are
off by {off} at most on the others. By extrapolation a router of one core passes on
{capacity} messages a second: some {drones} drones with their pilots.

Not measured: more than two routers in a row, network cards, TLS, zenohd, 1,000 real hubs.

## Drones that join at once

Hubs of drones and pilots are Zenoh routers, and each that joins is told to all. *Clients*: for
comparison; a hub cannot be one.

{joins}
"""
