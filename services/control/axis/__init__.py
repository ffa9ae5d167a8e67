"""The control law of one axis: state feedback, feed-forward, disturbance observer, gain
blending, and whether the sampled loop is stable. Imports no other room; the top of the service
joins the axes.
"""
