"""The kinds of clauses, a module each: values, JSON, words, what it asks of the search, drawing.

A new kind is a module here, its check in `verification` under the same name, and its words.
"""
