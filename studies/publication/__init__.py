"""The publication's tables, made anew by one command and set beside the published rows.

| module | subject |
|---|---|
| `stages` | commands that make the results, with the settings of each scale |
| `results` | result files in `studies/results`, and the journal of the stages that made them |
| `pictures` | figures 4 to 8, drawn from the result files |
| `page` | `docs/publication.md`, made of the result files and of the two tables in this folder |

`components.csv` lists the parts of the method as published and as they are here, `published.csv`
the figures of the publication.

Example:
    python -m studies.publication --smallest --out publication
"""
