"""The control law of one axis: state feedback, feed-forward, disturbance observer, gain
blending, and the stability of the sampled loop. Imports no other room; the top of the service
combines the axes.
"""
