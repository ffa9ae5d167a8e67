"""Cockpit: the pilot's page in a browser. Serves it, flies by it, and shows the dive to whoever
watches.

page_messages   what a page may send, and how it is checked
cockpit_pilot   which page has the sticks, and what it makes of them
page_view       what every page is shown
video           the camera's picture: as pages are sent it, and which pages get which
core            the state machine of all pages
io              web server
page            the page itself: HTML, CSS and ES modules, served as they are
"""
