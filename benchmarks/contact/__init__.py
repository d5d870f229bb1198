"""What contact costs and how exact it is, beside MuJoCo on the same scenes.

``make stage-report`` measures it and writes docs/contact-measured.md.
"""
