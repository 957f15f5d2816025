"""Solvers and penalties of PyLops and PyProximal, for oatkit."""
