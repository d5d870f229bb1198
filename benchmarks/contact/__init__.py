"""The cost and accuracy of contact, compared with MuJoCo on the same scenes.

``make stage-report`` measures it and writes docs/contact-measured.md.
"""
