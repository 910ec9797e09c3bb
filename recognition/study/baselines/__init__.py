"""The methods that TRFE is compared with, one file each, named after its paper.

Open-set methods work on frozen features of the shared encoder and reject by one rule (`recognition.study.baselines.method`).
"""
