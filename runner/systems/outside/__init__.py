"""Systems under test that live outside: functional mock-up units, OSI messages,
learners' arrays.
"""
