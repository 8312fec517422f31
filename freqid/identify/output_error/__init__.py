"""Maximum likelihood for dynamic models: parameters whose simulation comes nearest to what was measured.

Here belong models as pure functions, their ready forms and the estimators; equation error belongs in
`freqid.identify.regress`. Read model and parameters, then simulation, minimise, time_domain, estimate and
whiteness; frequency_domain and filter_error are two other estimators, response_fit that of frequency
responses.
"""
