"""How labels agree with what else is known of real recordings, as a report with plots.

    python -m recognition.study.agreement DATA OUT

DATA is a folder of recordings, OUT the folder for `agreement.md` and its plots.
"""
