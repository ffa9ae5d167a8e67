"""Options and help of verbs of `lindy`. What a verb does is in a module of `tools`, which is
imported only when the verb is called.
"""
