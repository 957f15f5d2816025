"""Images of oatkit in a viewer: upright, in mm, in colours that say what is shown; which wavelength is looked at."""
