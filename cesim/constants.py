"""Constants of nature."""

VACUUM_PERMITTIVITY = 8.8541878188e-12  #: F/m, CODATA 2022
