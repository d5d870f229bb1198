"""Random puppets: are their limbs found, and do they walk and bow?"""
