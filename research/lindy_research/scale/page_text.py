"""The words of docs/scale.md; `page` fills in its tables."""

PAGE_TEXT = """# How many drones a network carries

Written by `make docs`; do not edit. `python -m lindy_research.scale` prints it, and with
`--measure` measures its points anew.

## What a drone sends

From the topic table: the rows that the other side asks for, at their rates. A row that nobody asks
for is not sent. Video is not in it ([camera.md](camera.md)).

{traffic}

## The model

Two straight lines: a router needs so much of a core for each message that it passes on, and a link
carries the payload, and so many bytes more for each message. A message that crosses three routers
is counted at each.

{model}

Both are fitted, by least squares of relative errors, to every second of the points below, in the
order of their load. They were measured with synthetic drones and pilots, each with a hub of its own
as real ones have (`python -m tests.support.synthetic_fleet`), on two routers. Each of these is a
Python process with Zenoh's router and one thread. The computer: {where}.

*× rates*: times the table's rates. *link*: the one between both routers, as the operating system
counts its bytes in both directions, without the headers of TCP and IP. The delay is from a drone to
its pilot through both routers; on a busy computer its 99th percentile is that of the processes.

Of one point, 8 drones at the table's rates, only a quarter of the messages came at first, on a
computer that others kept busy; it was measured twice again, and both times all came. The last of
them is in the table.

Fitted to:

{fitted}

Checked on, and not fitted to:

{checked}

## Read off

Ten drones at the router of their site, 25 pilots at a router of the centre, and core routers
between them, each of which takes half a core at most. Every drone is flown, and two people watch
all with `lindy drones --watch`. The routers are those of the model, with one thread; zenohd has
more.

{fleets}

With the links of all sites thinned (`downsampling` in deploy/router.json5):

{thinned}

A router that takes a whole core passes on {capacity} messages a second, by extrapolation from a
tenth of that: some {drones} drones with their pilots.

## Drones that join at once

{joins}

The hubs of drones and pilots are Zenoh routers: each keeps a picture of the whole network, and each
that joins or leaves is told to all. 80 of them settle within seconds. 120 do not, also not after 90
seconds: they find each other and lose each other again, and most are never known at one time. All
of them ran on the two busy cores of this computer, so on computers of their own the number may be
larger; that has not been measured. Twice as many that are Zenoh clients of the router join at once.
A hub cannot be one today, because its own services are clients of it.

## Eight real drones on two cores

Too many: eight grouped drones and eight topsides with their viewers, on two routers, and on a
computer of 2 cores with other work, at load 40. All drones joined within 12 s, and four were armed
within two minutes. Of the topsides five ended with a sentence, one of them while it flew, because
the viewer was not alive within 30 s. Those four drones were flown badly and safely: 2,193 commands
were refused because they came too late; pilot lost acted 20 times, link lost 5 times and state lost
twice; stick to thruster took 55 to 106 ms, and 152 to 273 ms in the 99th percentile. No command
older than its time to live moved anything, no drone heard the pilot of another one, all ended
cleanly, the routers needed 0.01 of a core, and every recording was whole, four of them with gaps.
Where there are 8 processors, `lindy bench --only fleet` flies eight and measures them.

## What breaks first

1. **The number of hubs in one network**, long before any router has too many messages: see above.
   For 100 drones, and certainly for 1,000, the network must be parts that do not know each other's
   hubs: a router, or a few, for a class or a site, with drones and pilots of that part only. What
   this page reads off for 1,000 drones in one network is what its links and routers would carry,
   and not that it works.
2. **The uplink of a site.** Ten flown drones are more than most mobile networks carry upwards.
   Thinned they need less than a third. Commands are never thinned; they are small.
3. **A core router**: 1,000 drones need several, and Zenoh does not balance the load between them;
   who connects where is in the routers' files.

Two things hold: `lindy drones --watch` over all drones, which asks for three slow rows only, and
the routers of sites and of the centre.

Not measured: more than two routers in a row, network cards, TLS, zenohd, 1,000 real hubs.
"""
