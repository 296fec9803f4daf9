# Both commands of the README where there is no Debian: docker build -t structlearn . && docker run -it structlearn
FROM python:3.11-slim-bookworm
RUN apt-get update && apt-get install --yes --no-install-recommends g++ git make && rm -rf /var/lib/apt/lists/*
ENV PIP_EXTRA_INDEX_URL=https://download.pytorch.org/whl/cpu
WORKDIR /structlearn
COPY . .
RUN make .venv/installed
CMD ["make", "repro", "test"]
