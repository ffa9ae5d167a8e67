"""`lindy topic` and `lindy top`: what the streams and the services of a running dive do, as heard
on its bus. `figures` is pure; `listening` hears; `command` and `top` are the verbs."""
